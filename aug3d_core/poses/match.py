"""Names in a pose file -> photographs of the photo table. Plain Python."""

from __future__ import annotations

import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath
from typing import Any

import pandas as pd

from aug3d_core.geometry.camera_models import Camera, same_shape, scaled
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.files import Given
from aug3d_core.run.errors import InputError

FEWEST = 3
_LEAST_SHARE = 0.1  # of the smaller side; fewer common names are a coincidence
_EXAMPLES = 4
_LEAST_RESIZING = 0.1


def match_photos(entries: Sequence[Entry], photos: pd.DataFrame) -> list[Given]:
    """Find the photograph of each entry; raises InputError if most are missing, or if a shape does not fit.

    A name matches a photograph if the file names agree, or else the names without suffix. Folders decide between
    photographs with the same file name, and between names of the same entry.
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
                "Remove one of them, or name the photographs so that their folders differ.",
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
    """Return the photograph's row, and the number of folders that it shares with the name."""
    path = PurePosixPath(name.replace("\\", "/"))
    full, stem = _folded(path.name), _folded(path.stem)
    # A name without a suffix, as in Mega-NeRF's copies, is a stem already.
    candidates = by_name.get(full) or by_stem.get(stem) or by_stem.get(full)
    if not candidates:
        return None
    common = [_common_folders(path, candidate) for _, candidate in candidates]
    if common.count(max(common)) > 1:
        names = ", ".join(str(candidate) for _, candidate in candidates[:_EXAMPLES])
        raise InputError(
            f"{where} matches several photographs: {names}",
            "Add the photographs' folders to the names in the pose file.",
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
    """Return a name in lower case and in NFC: some systems store accents separately (NFD)."""
    return unicodedata.normalize("NFC", name).casefold()


def _given(photo: dict[Any, Any], entry: Entry, camera: Camera) -> Given:
    width, height = int(photo["original_width_px"]), int(photo["original_height_px"])
    sizes = (
        f"the camera is for {camera.width}x{camera.height} px, the photograph {photo['name']} has {width}x{height} px"
    )
    if not same_shape(camera, width, height):
        turned = (camera.width < camera.height) != (width < height)
        raise InputError(
            f"{entry.where}: {sizes}: {'one of them is rotated' if turned else 'the shapes differ'}",
            "Use the photographs that the poses were computed from, neither cropped nor rotated by their EXIF orientation.",
        )
    # Copies are scaled to 1/2 or 1/4, not by a few percent; undistorting crops a few percent.
    if camera.width != width and abs(camera.width / width - 1) < _LEAST_RESIZING:
        raise InputError(
            f"{entry.where}: {sizes}: these poses seem to be for undistorted copies",
            "Use the undistorted photographs, or the model from before undistortion.",
        )
    working = scaled(camera, int(photo["width_px"]), int(photo["height_px"]))
    return Given(int(photo["photo_id"]), entry.cam_from_world, working, camera, entry.source_id)


def _other_photos(entries: Sequence[Entry], photos: pd.DataFrame, matched: int) -> InputError:
    there = ", ".join(entry.names[0][0] for entry in entries[:_EXAMPLES])
    here = ", ".join(photos["name"].iloc[:_EXAMPLES])
    return InputError(
        f"the poses belong to other photographs: {matched} of their {len(entries)} names are among the {len(photos)} "
        f"photographs. In the pose file: {there}, ...; here: {here}, ...",
        "Use the photographs that the poses were computed from, with the same file names.",
    )
