"""The photos stage: folder of photographs -> photo table and working copies."""

from __future__ import annotations

import os
import statistics
import warnings
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import pandas as pd

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.contact_sheet import contact_sheet
from aug3d_core.photos.decisions import decisions
from aug3d_core.photos.decode import Decoded, decode, shown
from aug3d_core.photos.discover import Found, find_photos, natural_key
from aug3d_core.photos.files import CONTACT_SHEET, CONTROL_TABLE, PHOTO_IMAGES, PHOTO_TABLE, REJECTED_TABLE, image_name
from aug3d_core.photos.foreign import Seen, foreign_pictures
from aug3d_core.photos.masks import mask_notes, write_masks
from aug3d_core.photos.redundant import drop_redundant
from aug3d_core.photos.table import photo_table, rejected_table
from aug3d_core.run.errors import InputError
from aug3d_core.run.picture import PictureError, decoding_budget
from aug3d_core.run.stage import Inputs, Outcome, Progress

Rejected = list[tuple[str, str]]


def run(inputs: Inputs, config: PhotosConfig, out: Path, progress: Progress) -> Outcome:
    """Check every photograph of the folder, write working copies and the table."""
    folder = inputs["folder"]
    found = find_photos(folder)
    require_some(folder, found)
    (out / PHOTO_IMAGES).mkdir(parents=True, exist_ok=True)
    usable, rejected = _decode_all(folder, found, config, out, progress)
    usable, duplicates = drop_duplicates(usable)
    usable, foreign = _drop_foreign(usable)
    rejected += duplicates + foreign
    _require_enough(folder, found, config, usable, rejected)
    usable, redundant = _distinct(capture_order(usable), config)
    files = [photo.copy.rename(out / PHOTO_IMAGES / image_name(i)) for i, photo in enumerate(usable)]
    masked = write_masks(folder, found.masks, usable, out)
    table = photo_table(usable)
    table.to_parquet(out / PHOTO_TABLE)
    rejected_table(rejected + redundant).to_parquet(out / REJECTED_TABLE)
    contact_sheet(files, out / CONTACT_SHEET)
    outcome = _outcome(usable, rejected, len(redundant), found, len(set(table["camera"])), masked, config)
    return outcome.model_copy(update={"notes": outcome.notes + _control(folder, found, table, out)})


def _control(folder: Path, found: Found, table: pd.DataFrame, out: Path) -> tuple[str, ...]:
    """Write the marks of ground control points, if there are any; return notes on them."""
    if not found.control:
        return ()
    from aug3d_core.photos.control import read_control  # with GDAL, which most folders do without

    marks, notes = read_control(folder / found.control, table)
    marks.to_parquet(out / CONTROL_TABLE)
    return notes


def drop_duplicates(photos: Iterable[Decoded]) -> tuple[list[Decoded], Rejected]:
    """Keep the first of photographs with the same bytes or the same pixels; delete the other working copies."""
    kept: dict[str, Decoded] = {}
    rejected = []
    for photo in photos:
        first = kept.setdefault(photo.pixels_sha256, photo)
        if first is not photo:
            same = "bytes" if first.sha256 == photo.sha256 else "pixels"
            rejected.append((photo.name, f"duplicate: same {same} as {first.name}"))
            photo.copy.unlink()
    return list(kept.values()), rejected


def _drop_foreign(photos: list[Decoded]) -> tuple[list[Decoded], Rejected]:
    foreign = foreign_pictures(photos)
    for photo in photos:
        if photo.name in foreign:
            photo.copy.unlink()
    return [photo for photo in photos if photo.name not in foreign], list(foreign.items())


_Seen = TypeVar("_Seen", bound=Seen)


def capture_order(photos: list[_Seen]) -> list[_Seen]:
    """Sort by time, then by name; by name alone if any has no time, for a few times would tear the sequence apart."""
    timed = all(photo.exif.time for photo in photos)
    return sorted(photos, key=lambda photo: (photo.exif.time if timed else 0, natural_key(photo.name)))


def _distinct(photos: list[Decoded], config: PhotosConfig) -> tuple[list[Decoded], Rejected]:
    """Leave out what shows nothing new, if that is wanted; raises InputError where too few stay."""
    if not config.least_motion:
        return photos, []
    usable, redundant = drop_redundant(photos, config.least_motion)
    if len(usable) < config.min_photos:
        raise InputError(
            f"{len(photos)} photographs show what {len(usable)} show: the picture moves by less than "
            f"{config.least_motion:.0%} of its width between the others; at least {config.min_photos} are needed",
            "Photograph from more places, or set photos.least_motion=0 to use them all.",
        )
    return usable, redundant


def _decode_all(
    folder: Path, found: Found, config: PhotosConfig, out: Path, progress: Progress
) -> tuple[list[Decoded], Rejected]:
    budget = decoding_budget()

    def one(numbered: tuple[int, str]) -> Decoded | str:
        number, name = numbered
        try:
            return decode(folder / name, name, out / PHOTO_IMAGES / f"checking-{number}.png", config, budget)
        except PictureError as error:
            return str(error)

    usable, rejected = [], []
    with warnings.catch_warnings(), ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        # Pillow warns at 90 megapixels, which good cameras exceed (it refuses, as we want, at twice that), and of
        # corrupt EXIF, which we read as unknown. Set here, because filters are not safe to set within threads.
        warnings.simplefilter("ignore")
        for done, result in enumerate(pool.map(one, enumerate(found.names)), start=1):
            name = found.names[done - 1]
            usable.append(result) if isinstance(result, Decoded) else rejected.append((shown(name), result))
            progress(done, len(found.names), "photographs read")
    return usable, rejected


def require_some(folder: Path, found: Found) -> None:
    if not found.names:
        content = f"holds {found.ignored} files, none of them a photograph" if found.ignored else "is empty"
        raise InputError(f"{folder} {content}", "Put the JPEG, PNG or TIFF photographs there, or name another folder.")


def _require_enough(
    folder: Path, found: Found, config: PhotosConfig, usable: list[Decoded], rejected: Rejected
) -> None:
    if len(usable) < config.min_photos:
        examples = "".join(f"\n     {name}: {reason}" for name, reason in sorted(rejected)[:5])
        raise InputError(
            f"{folder} holds {len(usable)} usable photographs of {len(found.names)}; at least {config.min_photos} are "
            f"needed{examples}",
            "Add overlapping photographs of the scene, or repair those listed.",
        )


def _outcome(
    usable: list[Decoded],
    rejected: Rejected,
    redundant: int,
    found: Found,
    cameras: int,
    masked: Mapping[str, float],
    config: PhotosConfig,
) -> Outcome:
    notes = [f"{len(rejected)} photographs left out: {REJECTED_TABLE} says why"] if rejected else []
    if redundant:
        notes.append(f"{redundant} photographs show what the one before them shows and are left out")
    if 0 < (untimed := sum(photo.exif.time is None for photo in usable)) < len(usable):
        notes.append(f"{untimed} photographs have no time: the capture order is the order of names")
    notes += mask_notes(found, masked)
    metrics = {
        "photos": len(usable),
        "rejected": len(rejected),
        "redundant": redundant,
        "ignored_files": found.ignored,
        "masked": len(masked),
        "masked_share": round(sum(masked.values()) / len(usable), 4),
        "with_gps": sum(photo.exif.lat_deg == photo.exif.lat_deg for photo in usable),
        "with_focal": sum(photo.exif.focal_source != "none" for photo in usable),
        "cameras": cameras,
        "megapixels_median": statistics.median(w * h / 1e6 for w, h in (photo.original_size for photo in usable)),
        "sharpness_median": statistics.median(photo.sharpness for photo in usable),
        "sharpness_min": min(photo.sharpness for photo in usable),
    }
    return Outcome(
        metrics=metrics,
        state="degraded" if len(rejected) > len(usable) else "ok",
        notes=tuple(notes),
        pictures={"Photographs, in capture order": CONTACT_SHEET},
        decisions=tuple(decisions(metrics, config)),
    )
