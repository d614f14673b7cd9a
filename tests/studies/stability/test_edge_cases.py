"""The paper's edge cases at growing dose: each breaks the way that it should break, and never shared points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.studies.stability import edge_cases
from aug3d_core.studies.stability.edge_cases import BAD_MEMBERS
from aug3d_core.town.truth.edge_cases import abrupt_turn, high_rise, looking_apart, shaken

CASES = [
    (edge_cases.turns, 0.3, 2.5, "sequence"),
    (edge_cases.apart, 5.0, 35.0, "grid_any_angle"),
    (edge_cases.height, 10.0, 40.0, "ray"),
]


@pytest.mark.parametrize(("compute", "little", "much", "fails"), CASES)
def test_a_way_breaks_as_the_dose_grows_and_shared_points_do_not(compute, little, much, fails, tmp_path: Path) -> None:
    def bad(dose: float, method: str) -> float:
        return float(compute(dose, method, 1, tmp_path).metrics[BAD_MEMBERS])

    assert bad(little, fails) <= 0.1 and bad(much, fails) >= 0.4
    assert bad(much, "shared") == 0


def test_what_the_grouping_stage_would_say_is_told(tmp_path: Path) -> None:
    outcome = edge_cases.turns(2.5, "sequence", 0, tmp_path)
    assert outcome.state == "degraded" and "share next to nothing" in outcome.notes[0]
    (picture,) = outcome.pictures.values()
    with Image.open(tmp_path / picture) as image:
        assert min(image.size) > 300


def test_walls_that_hide_one_side_from_the_other_are_noticed_though_points_beyond_are_shared(tmp_path: Path) -> None:
    outcome = edge_cases.height(40.0, "ray", 1, tmp_path)
    by_points, by_surface = (outcome.metrics[f"members_{how}_share"] for how in ("apart", "unseen"))
    assert by_points < 0.2 < 0.5 < by_surface
    assert outcome.state == "degraded"


def test_doses_change_the_flight_and_nothing_else() -> None:
    assert len(abrupt_turn(4).views) == len(abrupt_turn(12).views) == 72
    assert len(looking_apart(10.0).views) == 90
    assert high_rise(30.0).mesh.xyz[:, 2].max() == 30.0


def test_flown_again_is_a_little_different_and_the_same_for_the_same_seed() -> None:
    case = high_rise()
    one, again, other = (shaken(case, np.random.default_rng(seed)).views.cam_from_world for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert 0 < np.abs(one - other).max() < 10
    rotation = one[:, :, :3]
    np.testing.assert_allclose(
        rotation @ rotation.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (60, 3, 3)), atol=1e-12
    )
