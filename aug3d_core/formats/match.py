"""Names in a pose file -> photographs of the photo table. Plain Python."""

from __future__ import annotations

import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath
from typing import Any

import pandas as pd

from aug3d_core.errors import InputError
from aug3d_core.formats.cameras import Camera, same_shape, scaled
from aug3d_core.formats.given import Entry, Given

FEWEST = 3
_LEAST_SHARE = 0.1  # of the smaller side; fewer common names are a coincidence
_EXAMPLES = 4
_LEAST_RESIZING = 0.1


def match_photos(entries: Sequence[Entry], photos: pd.DataFrame) -> list[Given]:
    """Find the photograph of each entry; raises InputError if hardly any are there, or a shape does not fit.

    A name is that of a photograph if the file names agree, else if the names without ending do; folders decide between
    photographs of the same file name, and between names of the same entry.
    """
    by_name, by_stem = _indices(photos["name"])
    found: dict[int, tuple[Entry, Camera]] = {}
    for entry in entries:
        places = [
            (place, camera) for name, camera in entry.names if (place := _find(name, by_name, by_stem, entry.where))
        ]
        if not places:
            continue
        (index, _), camera = max(places, key=lambda one: one[0][1])  # the first of equals
        if index in found:
            raise InputError(
                f"{entry.where} and {found[index][0].where} are both the photograph {photos['name'].iloc[index]}",
                "Remove one of them, or name the photographs so that their folders tell them apart.",
            )
        found[index] = entry, camera
    if len(found) < max(FEWEST, _LEAST_SHARE * min(len(entries), len(photos))):
        raise _other_photos(entries, photos, len(found))
    return [_given(photos.iloc[index].to_dict(), entry, camera) for index, (entry, camera) in sorted(found.items())]


def _indices(names: Iterable[str]) -> tuple[dict[str, list], dict[str, list]]:
    by_name, by_stem = defaultdict(list), defaultdict(list)
    for index, name in enumerate(names):
        path = PurePosixPath(name)
        by_name[_folded(path.name)].append((index, path))
        by_stem[_folded(path.stem)].append((index, path))
    return by_name, by_stem


def _find(name: str, by_name: dict[str, list], by_stem: dict[str, list], where: str) -> tuple[int, int] | None:
    """Return the photograph's row and how many folders it has in common with the name."""
    path = PurePosixPath(name.replace("\\", "/"))
    full, stem = _folded(path.name), _folded(path.stem)
    # A name without an ending, as Mega-NeRF's copies have, is a stem already.
    candidates = by_name.get(full) or by_stem.get(stem) or by_stem.get(full)
    if not candidates:
        return None
    common = [_common_folders(path, candidate) for _, candidate in candidates]
    if common.count(max(common)) > 1:
        names = ", ".join(str(candidate) for _, candidate in candidates[:_EXAMPLES])
        raise InputError(
            f"{where} may be any of the photographs {names}",
            "Give the photographs' folders their names in the pose file.",
        )
    return candidates[common.index(max(common))][0], max(common)


def _common_folders(a: PurePosixPath, b: PurePosixPath) -> int:
    count = 0
    for one, other in zip(a.parts[-2::-1], b.parts[-2::-1], strict=False):
        if _folded(one) != _folded(other):
            break
        count += 1
    return count


def _folded(name: str) -> str:
    """Return a name without case, and with marks as part of their letters: some systems store them apart (NFD)."""
    return unicodedata.normalize("NFC", name).casefold()


def _given(photo: dict[Any, Any], entry: Entry, camera: Camera) -> Given:
    width, height = int(photo["original_width_px"]), int(photo["original_height_px"])
    sizes = (
        f"the camera is for {camera.width}x{camera.height} px, the photograph {photo['name']} has {width}x{height} px"
    )
    if not same_shape(camera, width, height):
        turned = (camera.width < camera.height) != (width < height)
        raise InputError(
            f"{entry.where}: {sizes}: {'one of them is turned' if turned else 'another shape'}",
            "Give the photographs that the poses were made from, neither cropped nor turned by their EXIF orientation.",
        )
    # Copies are made half or a quarter as large, not a few percent smaller; undistorting crops a few percent.
    if camera.width != width and abs(camera.width / width - 1) < _LEAST_RESIZING:
        raise InputError(
            f"{entry.where}: {sizes}: these poses seem to be for undistorted copies",
            "Give the undistorted photographs, or the model from before undistorting.",
        )
    working = scaled(camera, int(photo["width_px"]), int(photo["height_px"]))
    return Given(int(photo["photo_id"]), entry.cam_from_world, working, camera, entry.source_id)


def _other_photos(entries: Sequence[Entry], photos: pd.DataFrame, matched: int) -> InputError:
    there = ", ".join(entry.names[0][0] for entry in entries[:_EXAMPLES])
    here = ", ".join(photos["name"].iloc[:_EXAMPLES])
    return InputError(
        f"the poses are of other photographs: {matched} of their {len(entries)} names are among the {len(photos)} "
        f"photographs. There: {there}, ...; here: {here}, ...",
        "Give the photographs that the poses were made from, under the same file names.",
    )
