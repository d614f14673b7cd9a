"""Films are what was drawn, and the same bytes every time."""

from __future__ import annotations

import av
import numpy as np
import pytest

from aug3d_core.judging import video


@pytest.mark.parametrize("size", [(64, 48), (63, 47)])
def test_a_film_shows_its_frames_and_is_the_same_twice(size, tmp_path):
    width, height = size
    ramp = np.linspace(0, 200, width * height * 3).reshape(height, width, 3)
    frames = [(ramp + 10 * n).astype(np.uint8) for n in range(5)]
    for name in ("one.webm", "two.webm"):
        video.save(frames, tmp_path / name, 8)
    assert (tmp_path / "one.webm").read_bytes() == (tmp_path / "two.webm").read_bytes()
    with av.open(tmp_path / "one.webm") as film:
        assert film.streams.video[0].average_rate == 8
        shown = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(shown) == 5
    for frame, truth in zip(shown, frames, strict=True):
        even = truth[: height // 2 * 2, : width // 2 * 2]
        assert frame.shape == even.shape and np.abs(frame.astype(float) - even).mean() < 6
