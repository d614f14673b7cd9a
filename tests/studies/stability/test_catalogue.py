"""The perturbations can be run as they are written down."""

from __future__ import annotations

import importlib

import pytest

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.stages import FROM_TOWN, STAGES
from aug3d_core.studies.stability.catalogue import PERTURBATIONS
from aug3d_core.studies.stability.perturbation import Computed, InFactory, Perturbation
from aug3d_core.studies.stability.perturbations.learning import PERTURBATIONS as LEARNING

NAMES = [stage.name for stage in FROM_TOWN]


def test_names_are_unique() -> None:
    assert len({p.name for p in PERTURBATIONS}) == len(PERTURBATIONS)


@pytest.mark.parametrize("perturbation", LEARNING[:2], ids=lambda p: p.name)
def test_the_rate_that_doses_multiply_is_told(perturbation: Perturbation) -> None:
    how = perturbation.how
    assert isinstance(how, InFactory)
    for method in perturbation.methods.values():
        once = scene_config("tiny", (*how.world, *how.overrides(1, method, 1)))
        assert f"a rate of {once.training.learning_rate:g}." in perturbation.what


@pytest.mark.parametrize("perturbation", PERTURBATIONS, ids=lambda p: p.name)
def test_a_perturbation_can_be_run(perturbation: Perturbation) -> None:
    assert (
        perturbation.what.endswith(".")
        and len(perturbation.doses) >= 4
        and len(set(perturbation.doses)) == len(perturbation.doses)
    )
    assert perturbation.judge.why
    how = perturbation.how
    module, _, name = (
        how.compute if isinstance(how, Computed) else how.damage.function if how.damage else ""
    ).partition(":")
    assert not module or callable(getattr(importlib.import_module(module), name))
    if isinstance(how, InFactory):
        assert perturbation.judge.stage in STAGES
        assert NAMES.index(perturbation.judge.stage) <= NAMES.index(how.until)
        for dose in perturbation.doses:
            for method in perturbation.methods.values():
                scene_config("tiny", (*how.world, *how.overrides(dose, method, 1)))
