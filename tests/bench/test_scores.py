"""The figures of a judged scene: each start against its own cheap answers, under names that programs know."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from aug3d_core.bench import generalisation, heads
from aug3d_core.bench.scores import photo_sets, scene_scores
from aug3d_core.run.errors import InputError

CHEAP = {
    "ground_homography_psnr": 19.0,
    "plane_sweep_psnr": 18.0,
    "mesh_render_psnr": 25.0,
    "guided_blend_psnr": 26.0,
}
FREE = {"inputs_alone_psnr": 22.5, "inputs_alone_ssim": 0.7}


def judged(**scores: float) -> pd.DataFrame:
    """Return a test in which every view has the same scores."""
    return pd.DataFrame([{"group": group, **CHEAP, **scores} for group in range(4)])


def test_each_start_is_held_against_its_own_answers() -> None:
    found = scene_scores(judged(psnr=26.5, ssim=0.9, **FREE), "town", heads.GOALS["town"])
    assert found["town_free_over_homography_db"].value == pytest.approx(3.5)
    assert found["town_free_over_best_cheap_db"].value == pytest.approx(3.5)
    assert found["town_scaffold_over_guided_db"].value == pytest.approx(0.5)
    assert {name.removeprefix("town_"): figure.holds for name, figure in found.items() if figure.goal} == {
        "free_ssim": False,
        "free_over_homography_db": True,
        "free_over_sweep_db": True,
        "scaffold_over_mesh_db": False,
        "scaffold_over_guided_db": False,
    }
    assert json.dumps({name: vars(figure) for name, figure in found.items()})


def test_a_model_without_a_scaffold_has_no_figures_about_one() -> None:
    found = scene_scores(judged(psnr=22.5, ssim=0.7), "town", {})
    assert found["town_free_psnr"].value == 22.5
    assert not [name for name in found if "scaffold" in name]


def test_every_goal_is_of_a_figure_that_there_is() -> None:
    for name, goals in (heads.GOALS | generalisation.GOALS).items():
        found = scene_scores(judged(psnr=26.5, ssim=0.9, **FREE), name, goals)
        assert {key.removeprefix(f"{name}_") for key, figure in found.items() if figure.goal} == set(goals)


def test_a_lead_that_some_views_do_not_share_has_a_low_end_below_zero() -> None:
    views = judged(psnr=26.5, ssim=0.9, **FREE).assign(inputs_alone_psnr=[25.0, 17.0, 24.0, 18.0])
    found = scene_scores(views, "town", {})
    assert found["town_free_over_homography_db"].value == pytest.approx(2.0)
    assert found["town_free_over_homography_low"].holds is False


def test_folders_of_photographs_are_found_by_the_first_word_of_their_name(tmp_path: Path) -> None:
    for name in ("brighton_beach/images", "ochota", "town_north", "town_south", "notes"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / ("read.me" if name == "notes" else "1.jpg")).touch()
    assert {name: folder.name for name, folder in photo_sets(tmp_path).items()} == {
        "brighton": "brighton_beach",
        "ochota": "ochota",
        "town_north": "town_north",
        "town_south": "town_south",
    }
    assert photo_sets(None) == {}


def test_a_folder_without_photographs_is_named(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError, match=f"{folder} holds no folder"):
            photo_sets(folder)
