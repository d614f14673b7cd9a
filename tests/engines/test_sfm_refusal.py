"""Photographs that cannot become a scene end in an error that says why, never in a scene that looks like one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.geometry.transforms import look_at
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.refusal import nothing_found, refuse_short_baseline
from tests.engines.little_scene import poses, write_flight
from tests.engines.sfm_runs import run_sfm, take_photos

pytestmark = pytest.mark.slow


def turned() -> np.ndarray:
    """Return cameras that look around from one spot."""
    aims = [np.array([x, y, 0.0]) for x in (-16, -8, 0, 8, 16) for y in (-12, 0, 12)]
    return np.stack([look_at(np.array([0.0, 0.0, 50.0]), aim) for aim in aims])


def test_one_spot_shows_no_depth(tmp_path: Path) -> None:
    error = run_sfm(take_photos(write_flight(tmp_path / "in", turned()), tmp_path / "photos"), tmp_path / "sfm")
    assert "taken from one spot" in error["problem"]
    assert "camera moved" in error["remedy"]


def test_one_spot_with_a_wrong_focal_length_is_doubted(tmp_path: Path) -> None:
    photos = take_photos(write_flight(tmp_path / "in", turned(), gps=False, focal_35mm=60), tmp_path / "photos")
    outcome = run_sfm(photos, tmp_path / "sfm")
    assert outcome["state"] == "degraded"
    assert any("may have turned on one spot" in note for note in outcome["notes"])


def test_a_bare_field_has_no_texture(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for i in range(8):
        rng = np.random.default_rng(i)
        grey = 120 + 10 * np.linspace(0, 1, 320)[None, :, None] + rng.normal(size=(240, 320, 3))
        Image.fromarray(grey.astype(np.uint8)).save(tmp_path / "in" / f"{i}.jpg")
    error = run_sfm(take_photos(tmp_path / "in", tmp_path / "photos"), tmp_path / "sfm")
    assert "no texture" in error["problem"]
    assert "detail" in error["remedy"]


@pytest.mark.parametrize("mapper", ["incremental", "global", "hierarchical"])
def test_photographs_of_nothing_in_common_do_not_overlap(tmp_path: Path, mapper: str) -> None:
    for i in range(4):
        write_flight(tmp_path / "in", poses(1, 1), gps=False, seed=i, start=i)
    error = run_sfm(take_photos(tmp_path / "in", tmp_path / "photos"), tmp_path / "sfm", sfm={"mapper": mapper})
    assert "4 of them overlap with fewer than two others" in error["problem"]
    assert "overlap by 60 %" in error["remedy"]


def test_cameras_too_close_together_are_refused() -> None:
    at = np.random.default_rng(0).normal(size=(20, 3))
    refuse_short_baseline(at, median_depth=30.0)
    with pytest.raises(InputError, match="taken from one spot") as error:
        refuse_short_baseline(at, median_depth=60.0)
    assert "camera moved" in error.value.remedy


def test_overlap_that_fits_no_rigid_scene_is_said_to() -> None:
    error = nothing_found(pd.DataFrame({"features": [3000] * 9, "matched_pairs": [8] * 9}))
    assert "does not fit together as one rigid scene" in error.problem
    assert "taken from places apart" in error.remedy
