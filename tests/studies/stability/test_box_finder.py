"""Villages whose houses are known exactly, and what the finder of buildings makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.studies.stability import box_finder
from aug3d_core.studies.stability.box_finder import BOX_F1, DIVIDED, OVER_GRID, PERCENTILE
from aug3d_core.studies.stability.box_world import slope, terrace, village


def test_houses_stand_on_the_land_and_off_one_another() -> None:
    made = village(12, 5, 5, slope(20.0), np.random.default_rng(3))
    assert len(made.boxes) == 12
    west, south, east, north = made.boxes.T
    assert ((east - west) >= 9).all() and ((north - south) <= 14).all()
    apart = (west[:, None] >= east) | (west >= east[:, None]) | (south[:, None] >= north) | (south >= north[:, None])
    assert (apart | np.eye(12, dtype=bool)).all()
    above = made.mesh.xyz[:, 2] - slope(20.0)(made.mesh.xyz[:, 1])
    assert above.min() >= -6 and 5 <= above.max() <= 12


def test_half_of_a_terraced_village_is_higher() -> None:
    np.testing.assert_array_equal(terrace(8.0)(np.array([-5.0, 5.0])), [0, 8])


@pytest.mark.parametrize("method", [DIVIDED, PERCENTILE])
def test_all_houses_are_found_on_a_slope(method: str, tmp_path: Path) -> None:
    outcome = box_finder.on_slope(20.0, method, 0, tmp_path)
    assert outcome.metrics[BOX_F1] == 1 and outcome.state == "ok"
    assert float(outcome.metrics[OVER_GRID] or 0) > 3
    assert (tmp_path / next(iter(outcome.pictures.values()))).exists()


def test_a_village_without_houses_is_told(tmp_path: Path) -> None:
    outcome = box_finder.few_houses(12, DIVIDED, 0, tmp_path)
    assert outcome.metrics[BOX_F1] == 1 and outcome.state == "degraded"
    assert "no building" in outcome.notes[0]


def test_a_percentile_fails_on_high_terraces_and_the_stage_says_so(tmp_path: Path) -> None:
    outcome = box_finder.on_terraces(16, PERCENTILE, 0, tmp_path)
    assert float(outcome.metrics[BOX_F1] or 0) < 0.5 and outcome.state == "degraded"
    assert "domes wanted found a place" in outcome.notes[0]
