"""Every stage is declared once, and what is declared beside its code does not change its key."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from aug3d_core.factory import stages
from aug3d_core.factory.config import AUTO, PRESETS, SceneConfig
from aug3d_core.factory.stages import STAGES, TRAINING
from aug3d_core.heads.config import names
from aug3d_core.run.nested import flat
from aug3d_core.run.stage import Stage
from aug3d_core.store.code import reached
from aug3d_core.training.config import presets

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
    tiny = [stage.presets["tiny"]] if stage.presets else []
    tiny += [presets(name)["tiny"] for name in names()] if stage is TRAINING else []
    assert set(stage.decidable) <= {field for config in tiny for field in flat(config.model_dump())}
    assert stage.accuracy in stage.metrics


@pytest.mark.parametrize("stage", EVERY, ids=lambda stage: stage.entry)
def test_declarations_are_no_part_of_what_a_key_hashes(stage: Stage) -> None:
    assert not [node for node in reached((stage.entry,)) if node.module.rpartition(".")[2] == "declared"]
