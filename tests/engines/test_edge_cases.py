"""The paper's edge cases: the way of grouping that should fail fails, shared points do not, and the picture shows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.bench.grouping import MOST_BAD
from aug3d_core.groups.methods import METHODS
from aug3d_core.studies.common.edge_case_trial import Tried, draw_cases, try_case
from aug3d_core.town.truth.edge_cases import edge_cases

FAILING = 0.2


@pytest.fixture(scope="module")
def tried() -> list[Tried]:
    return [try_case(case) for case in edge_cases()]


def test_the_ways_that_should_fail_do_and_shared_points_do_not(tried: list[Tried]) -> None:
    for one in tried:
        assert one.case.fails and set(one.case.fails) <= set(METHODS)
        assert one.bad_share("shared") <= MOST_BAD, one.case.name
        for way in one.case.fails:
            assert one.bad_share(way) >= FAILING, f"{one.case.name}: {way}"


def test_the_cases_are_always_the_same() -> None:
    for one, again in zip(edge_cases(), edge_cases(), strict=True):
        assert (one.mesh.rgb == again.mesh.rgb).all() and (one.views.cam_from_world == again.views.cam_from_world).all()


def test_the_picture_shows_every_case(tried: list[Tried], tmp_path: Path) -> None:
    draw_cases(tried, tmp_path / "cases.png")
    with Image.open(tmp_path / "cases.png") as image:
        pixels = np.asarray(image.convert("RGB"))
    red = (pixels[..., 0] == 214) & (pixels[..., 1] == 30) & (pixels[..., 2] == 30)
    thirds = np.array_split(red, len(tried), axis=1)
    assert all(third.sum() > 100 for third in thirds), "bad members are framed in every case"
