"""Every stage is declared once, and what is declared beside its code does not change its key."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from aug3d_core.factory import stages
from aug3d_core.factory.config import AUTO, PRESETS, SceneConfig
from aug3d_core.factory.stages import STAGES
from aug3d_core.run.nested import flat
from aug3d_core.run.stage import Stage
from aug3d_core.store.code import reached

EVERY = [stage for stage in vars(stages).values() if isinstance(stage, Stage)]


@pytest.mark.parametrize("stage", EVERY, ids=lambda stage: stage.entry)
def test_each_stage_can_be_run_by_its_package(stage: Stage) -> None:
    assert find_spec(f"{stage.package}.__main__"), f"python -m {stage.package} runs nothing"


def test_a_scene_has_the_settings_of_every_stage_with_presets() -> None:
    declared = {stage.name: stage.config for stage in STAGES.values() if stage.presets}
    fields = {name: field.annotation for name, field in SceneConfig.model_fields.items() if name != "auto"}
    assert fields == declared


@pytest.mark.parametrize("stage", EVERY, ids=lambda stage: stage.entry)
def test_a_stage_is_declared_in_full(stage: Stage) -> None:
    assert stage.description.endswith(".")
    assert set(stage.presets) in (set(), set(PRESETS) - {AUTO})
    assert {type(config) for config in stage.presets.values()} <= {stage.config}
    settings = flat(stage.presets["tiny"].model_dump()) if stage.presets else {}
    assert set(stage.decidable) <= set(settings)
    assert stage.accuracy in stage.metrics


@pytest.mark.parametrize("stage", EVERY, ids=lambda stage: stage.entry)
def test_declarations_are_no_part_of_what_a_key_hashes(stage: Stage) -> None:
    assert not [node for node in reached((stage.entry,)) if node.module.rpartition(".")[2] == "declared"]
