"""The poses stage: pose files in a known format and the photo table -> one table of poses, in the source's frame."""

from __future__ import annotations

import shutil
from pathlib import Path

from aug3d_core.photos.files import read_photos
from aug3d_core.poses import recognise
from aug3d_core.poses.config import PosesConfig
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.files import GIVEN_MODEL, Given, write_given
from aug3d_core.poses.match import match_photos
from aug3d_core.run.stage import Inputs, Outcome, Progress

_FEW = 0.5


def run(inputs: Inputs, config: PosesConfig, out: Path, progress: Progress) -> Outcome:
    """Read the poses, find their photographs, and keep the source's model if it has points."""
    found, photos = recognise.recognise(inputs["given"]), read_photos(inputs["photos"])
    entries = read_entries(found)
    progress(1, 2, "pose files read")
    given = match_photos(entries, photos)
    write_given(given, out)
    if found.has_points:
        (out / GIVEN_MODEL).mkdir()
        for file in found.files:
            shutil.copyfile(file, out / GIVEN_MODEL / file.name)
    progress(2, 2, "photographs found")
    share = len(given) / len(photos)
    return Outcome(
        metrics={
            "format": found.kind,
            "poses": len(entries),
            "matched": len(given),
            "matched_share": share,
            "with_points": found.has_points,
            "camera_models": ", ".join(sorted({one.original.model for one in given})),
            "resized_share": _resized(given) / len(given),
        },
        state="degraded" if share < _FEW else "ok",
        notes=_notes(entries, given, len(photos)),
    )


def read_entries(found: recognise.PoseFiles) -> list[Entry]:
    """Read pose files of any format. Only the engine of that format is imported: no process holds two."""
    if found.kind == recognise.COLMAP:
        from aug3d_core.poses.colmap import read_colmap

        return read_colmap(found.folder)
    if found.kind == recognise.MEGA_NERF:
        from aug3d_core.poses.mega_nerf import read_mega_nerf

        return read_mega_nerf(found)
    from aug3d_core.poses.nerfstudio import read_transforms

    return read_transforms(found.files[0])


def _resized(given: list[Given]) -> int:
    return sum(one.original.width != one.camera.width for one in given)


def _notes(entries: list[Entry], given: list[Given], photos: int) -> tuple[str, ...]:
    notes = []
    if len(given) < photos:
        notes.append(f"{photos - len(given)} of {photos} photographs have no pose in the file and are left out")
    if len(given) < len(entries):
        notes.append(f"{len(entries) - len(given)} of {len(entries)} poses belong to photographs that are not here")
    if masked := sum(entry.mask is not None for entry in entries):
        notes.append(
            f"the masks that {masked} poses name are not read: a run reads that of IMG_1.JPG from IMG_1_mask.png beside it"
        )
    return tuple(notes)
