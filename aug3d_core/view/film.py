"""A path through key views as a film of predictions, in a new file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aug3d_core.judging import video
from aug3d_core.run.errors import InputError, UsageError
from aug3d_core.view.poses import Pose, through

if TYPE_CHECKING:
    from aug3d_core.view.predictor import Predictor

FRAMES_PER_SECOND = 24
SECONDS = 2  # from a key view to the next


def write_film(
    predictor: Predictor, keys: Sequence[Pose], folder: Path, name: str, report: Callable[[int, int], None]
) -> Path:
    """Predict the frames of a path through two or more key views, and return the new file.

    A frame of which no photograph shows anything repeats the one before it. Raises UsageError for fewer key views, or a folder
    that takes no file; InputError if no frame can be predicted.
    """
    if len(keys) < 2:
        raise UsageError(f"{len(keys)} key views make no path", "add two or more, each from another place")
    total = FRAMES_PER_SECOND * SECONDS * (len(keys) - 1)
    poses = through(np.stack([key.world_from_cam for key in keys]), total, predictor.scene.scale)
    fov_rad = float(np.mean([key.fov_rad for key in keys]))
    frames, why = [], None
    for done, pose in enumerate(poses):
        report(done, total)
        try:
            frames.append(predictor.predict(Pose(pose, fov_rad)).colour)
        except InputError as error:
            why = error
            frames += frames[-1:]
    if not frames:
        assert why
        raise why
    file = new_file(folder, name)
    try:
        video.save(frames, file, FRAMES_PER_SECOND)
    except BaseException as error:
        file.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise UsageError(f"{file} cannot be written: {error}", "make room, or start aug3d view elsewhere") from error
    report(total, total)
    return file


def new_file(folder: Path, name: str) -> Path:
    """Create a file that was not there; raises UsageError if the folder takes none."""
    for number in count(1):
        file = folder / f"{name}_{number}.webm"
        try:
            file.touch(exist_ok=False)
        except FileExistsError:
            continue
        except OSError as error:
            raise UsageError(f"{file} cannot be written: {error}", "start aug3d view in a folder of yours") from error
        return file
    raise AssertionError
