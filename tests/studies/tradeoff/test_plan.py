"""Every setting that is tried exists and takes every value; the grid is whole, and names what differs."""

from __future__ import annotations

from itertools import product
from math import prod

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.stages import STAGES
from aug3d_core.heads.config import names
from aug3d_core.studies.tradeoff.plan import auto_arm, axes, grid_arms, quick_effort, rungs, setting_arms
from aug3d_core.studies.tradeoff.setting import (
    AS_THE_PAPER,
    QUICK,
    SETTINGS,
    STEPS,
    Setting,
    has,
    papers_values,
    resolved,
    spelled,
    value_of,
)

EFFORT = {  # no part of a network
    "steps": True, "least_gain_db": True, "checkpoint_every": True, "head": {"encoder_weights"}
}  # fmt: skip
SIZED = ("tiny", "small", "paper")


@pytest.mark.parametrize("preset", SIZED)
@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_settings_exist_and_values_are_allowed(setting: Setting, preset: str) -> None:
    heads = [[f"training.head={name}"] for name in names()]
    known = [head for head in heads if all(has(field, scene_config(preset, head)) for field in setting.fields)]
    assert known
    for head, value in product(known, setting.values):
        config = scene_config(preset, head)
        scene_config(preset, [*head, *(f"{field}={resolved(field, value, config)}" for field in setting.fields)])
    scene_config(preset, [f"{field}=1" for field in setting.seeded])
    assert {*setting.stages, setting.truth.stage, setting.stand_in.stage} <= set(STAGES)


@given(
    st.sampled_from(["training.steps", "sampling.domes", "training.head.features"]),
    st.integers(1, 9),
    st.integers(1, 9),
)
def test_a_share_of_a_count_is_a_count(field: str, over: int, under: int) -> None:
    config = scene_config("tiny")
    value = int(resolved(field, f"x{over}/{under}", config))
    exact = over / under * float(value_of(field, config))
    assert (value >= 1 and abs(value - exact) <= 0.5 + 1e-9) or exact < 1


def test_sizes_stay_what_the_data_set_takes_and_words_stay_words() -> None:
    config = scene_config("small")
    assert resolved("dataset.width_px", "x2/3", config) == "340" and resolved("matching.pairs", "gps", config) == "gps"
    assert resolved("surface.texel_gsd", "x1.4", config) == "1.4" and spelled(2.0) == "2"


@given(st.integers(64, 4000), st.integers(64, 4000))
def test_the_scenes_own_values_are_in_the_grid_whatever_they_are(photo_px: int, depth_px: int) -> None:
    config = scene_config("tiny", [f"photos.max_px={photo_px}", f"depth.max_px={depth_px}"])
    assert [arm.mark for arm in grid_arms(config, False)].count("preset") == 1
    assert resolved("depth.max_px", "x1", config) == str(depth_px)


@pytest.mark.parametrize("head", names())
@pytest.mark.parametrize("town", [True, False])
@pytest.mark.parametrize("quick", [True, False])
def test_every_panel_has_one_arm_as_the_scene_has_it(head: str, town: bool, quick: bool) -> None:
    config = scene_config("tiny", [f"training.head={head}"])
    arms = setting_arms(config, town, quick)
    panels = {arm.panel for arm in arms}
    there = {setting.name for setting in SETTINGS if all(has(field, config) for field in setting.fields)}
    assert panels == (there & set(QUICK) if quick else {*there, AS_THE_PAPER.name})
    assert len(there & set(QUICK)) == 4, "one of every kind"
    for panel in panels:
        labels = [arm.label for arm in arms if arm.panel == panel]
        assert len(set(labels)) == len(labels) >= 2
        assert sum(arm.mark == "preset" for arm in arms if arm.panel == panel) == 1
    assert town or not {"truth", "mesh_truth"} & {arm.judge.stage for arm in arms}


@pytest.mark.parametrize("head", names())
@pytest.mark.parametrize("preset", SIZED)
def test_all_steps_back_to_the_paper_together_are_its_network(preset: str, head: str) -> None:
    chosen = f"training.head={head}"
    config = scene_config(preset, [chosen])
    back = papers_values(config)
    network = scene_config(preset, [chosen, *(f"{field}={value}" for field, value in back.items())]).training
    assert network.model_dump(exclude=EFFORT) == scene_config("paper", [chosen]).training.model_dump(exclude=EFFORT)
    arms = [arm for arm in setting_arms(config, True, False) if arm.panel == AS_THE_PAPER.name]
    changed = [arm.settings[2:] for arm in arms]  # after steps and their warm-up, which are alike
    alone = {field for setting in SETTINGS for field in setting.fields}
    assert changed == [(), *((f"{field}={value}",) for field, value in back.items() if field not in alone)]
    assert len({arm.settings[:1] for arm in arms}) == 1 and arms[0].mark == "preset"


@pytest.mark.parametrize("quick", [True, False])
def test_settings_of_another_head_have_no_panel_and_no_axis(quick: bool) -> None:
    """A head without a width and without rays is studied by what it has."""
    lacks = {"training.head.hidden", "training.head.coarse_samples"}
    config = scene_config("tiny")
    panels = {arm.panel for arm in setting_arms(config, True, quick)}
    assert "features per photograph" in panels and not {"width of the network", "samples on a ray"} & panels
    assert not lacks & set(axes(config, quick)) and grid_arms(config, quick)


@pytest.mark.parametrize("quick", [True, False])
def test_the_grid_is_whole_and_has_the_scene_in_it(quick: bool) -> None:
    config = scene_config("tiny")
    arms, values, steps = grid_arms(config, quick), axes(config, quick), rungs(config, quick)
    assert len({arm.settings for arm in arms}) == len(arms) == prod(map(len, values.values())) * len(steps)
    assert [arm.label for arm in arms if arm.mark == "preset"] == ["as the scene has it"]
    assert len({arm.label for arm in arms}) == len(arms)
    chosen = {(*(one.partition("=")[2] for one in arm.settings[:-1]), arm.settings[-1]) for arm in arms}
    assert chosen == {(*some, f"{STEPS}={n}") for *some, n in product(*values.values(), steps)}


def test_a_quick_look_trains_for_seconds_and_auto_sets_nothing_by_hand() -> None:
    config = scene_config("tiny")
    quick = scene_config("tiny", quick_effort(config))
    assert quick.training.steps == round(config.training.steps / 20) and quick.training.warmup_steps == 1
    assert auto_arm().settings == () and rungs(quick, True) == [2, 5]
