"""A film has its frames in order, and never takes the place of another file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from aug3d_core.judging import video
from aug3d_core.run.errors import InputError, UsageError
from aug3d_core.view.film import FRAMES_PER_SECOND, SECONDS, new_file, write_film
from aug3d_core.view.pictures import Predicted
from aug3d_core.view.poses import Pose


class Grey:
    """Predicts the camera's height as a grey; nothing at the given heights."""

    scene = type("Scene", (), {"scale": 10.0})

    def __init__(self, blind: range = range(0)) -> None:
        self.blind = blind

    def predict(self, pose: Pose) -> Predicted:
        height = round(pose.world_from_cam[2, 3])
        if height in self.blind:
            raise InputError("no photograph shows what is in view", "turn")
        return Predicted(np.full((34, 46, 3), height, np.uint8), None, None, (), False, 0.1)


def keys(*heights: float) -> list[Pose]:
    poses = np.tile(np.eye(4), (len(heights), 1, 1))
    poses[:, 2, 3] = heights
    return [Pose(pose, 0.8) for pose in poses]


def greys(file: Path) -> list[float]:
    with av.open(str(file)) as film:
        return [float(frame.to_ndarray(format="rgb24").mean()) for frame in film.decode(video=0)]


def made(predictor: Any, heights: tuple[float, ...], folder: Path) -> Path:
    return write_film(predictor, keys(*heights), folder, "view_toy", lambda done, total: None)


def test_it_goes_through_its_key_views(tmp_path: Path) -> None:
    shown = greys(made(Grey(), (20, 120, 220), tmp_path))
    assert len(shown) == 2 * SECONDS * FRAMES_PER_SECOND
    assert shown == sorted(shown)
    assert abs(shown[0] - 20) < 4 and abs(shown[-1] - 220) < 4


def test_each_has_its_own_file(tmp_path: Path) -> None:
    (tmp_path / "view_toy_1.webm").write_text("the user's")
    assert made(Grey(), (20, 40), tmp_path).name == "view_toy_2.webm"
    assert made(Grey(), (20, 40), tmp_path).name == "view_toy_3.webm"
    assert (tmp_path / "view_toy_1.webm").read_text() == "the user's"


def test_where_nothing_is_seen_the_last_frame_stays(tmp_path: Path) -> None:
    shown = greys(made(Grey(range(100, 140)), (20, 220), tmp_path))
    assert len(shown) == SECONDS * FRAMES_PER_SECOND
    assert max(np.diff(shown)) > 30


def test_a_path_in_the_dark_is_told_and_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no photograph shows"):
        made(Grey(range(1000)), (20, 220), tmp_path)
    assert not list(tmp_path.iterdir())


def test_one_view_is_no_path(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="1 key views make no path"):
        made(Grey(), (20,), tmp_path)


def test_a_folder_that_is_gone_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        new_file(tmp_path / "gone", "view_toy")


@pytest.mark.parametrize("error", [MemoryError("none left"), OSError("no codec"), KeyboardInterrupt("stopped")])
def test_a_film_that_cannot_be_written_leaves_no_file(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> None:
        raise error

    monkeypatch.setattr(video, "save", failing)
    with pytest.raises(UsageError if isinstance(error, OSError) else type(error), match=str(error)):
        made(Grey(), (20, 40), tmp_path)
    assert not list(tmp_path.iterdir())
