"""What two pictures have in common."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.look.glance import Glance, glances
from aug3d_core.look.neighbours import NOTHING, Step, steps_between
from tests.look.flown import SIZE_PX, WIDTH_M, Shot, take


def step(folder: Path, first: Shot, second: Shot, **how: object) -> Step:
    take(folder, [first, second], **how)  # pyright: ignore[reportArgumentType]
    seen: list[Glance] = glances(folder, [first.name, second.name], 16, lambda *_: None)[0]
    [between] = steps_between(seen)
    return between


@pytest.mark.parametrize("turned", [0.0, 30.0, 180.0])
def test_motion_turn_and_overlap(tmp_path: Path, turned: float) -> None:
    between = step(tmp_path, Shot("a.jpg", 0, 0), Shot("b.jpg", 0, 0.25 * WIDTH_M, turned))
    turn = np.radians(turned)  # of the camera, clockwise: what it sees turns the other way
    assert between.moved == pytest.approx((0.25 * np.sin(turn), 0.25 * np.cos(turn)), abs=0.01)
    assert np.degrees(between.turned_rad) % 360 == pytest.approx(-turned % 360, abs=1)
    assert between.scale == pytest.approx(1, abs=0.02)
    if turned in (0.0, 180.0):
        assert between.overlap == pytest.approx(1 - 0.25 * SIZE_PX[0] / SIZE_PX[1], abs=0.02)


def test_pictures_of_different_places_have_nothing_in_common(tmp_path: Path) -> None:
    assert step(tmp_path, Shot("a.jpg", -100, 0), Shot("b.jpg", 100, 0)) is NOTHING


def test_nothing_is_found_where_nothing_can_be_told_apart(tmp_path: Path) -> None:
    grey = Image.new("L", SIZE_PX, 128)
    assert step(tmp_path, Shot("a.jpg", 0, 0), Shot("b.jpg", 5, 0), changed=lambda *_: grey) is NOTHING
