"""The search ends near the full grid's choice for a few times its cost, and says so when nothing reaches the target."""

from __future__ import annotations

from itertools import product
from statistics import median

import pytest

from aug3d_core.studies.tradeoff.search import Search, Tried, search
from tests.studies.tradeoff.landscape import AXES, RUNGS, Landscape

LANDSCAPES = range(40)


def full_grid(landscape: Landscape) -> list[tuple[tuple[str, ...], int, Tried]]:
    grid = product(*AXES.values())
    chosen = [tuple(f"{name}={value}" for name, value in zip(AXES, values, strict=True)) for values in grid]
    return [(settings, steps, landscape(settings, steps)) for settings in chosen for steps in RUNGS]


def psnr(tried: Tried) -> float:
    assert tried.psnr_db is not None
    return tried.psnr_db


@pytest.mark.parametrize("below_best_db", [0.3, 1.0])
def test_it_is_near_the_full_grid_for_a_few_times_the_cost_of_its_choice(below_best_db: float) -> None:
    regrets, ratios, dearer = [], [], []
    for seed in LANDSCAPES:
        landscape = Landscape(seed, noise_db=0.1)
        grid = full_grid(landscape)
        target = max(psnr(tried) for _, _, tried in grid) - below_best_db
        choice = min((t for _, _, t in grid if psnr(t) >= target), key=lambda tried: tried.cost_s)
        found = search(AXES, RUNGS, target, landscape)
        assert found.reached is not None and found.found == found.reached
        regrets.append(psnr(choice) - found.reached.psnr_db)
        ratios.append(found.spent_s / choice.cost_s)
        dearer.append(found.reached.tried.cost_s / choice.cost_s)
    assert max(regrets) <= 0.2 and median(ratios) <= 5.0
    assert median(dearer) <= 1.2, "the dearest configuration reaches the target too"


def test_it_tries_nothing_twice_and_never_everything() -> None:
    landscape = Landscape(1, noise_db=0.1)
    found = search(AXES, RUNGS, 22.5, landscape)
    tried = [(trial.settings, trial.steps) for trial in found.trials]
    assert len(set(tried)) == len(tried) == landscape.asked < 16 * len(RUNGS) / 2


def test_the_same_search_tries_the_same() -> None:
    one, other = (search(AXES, RUNGS, 23.0, Landscape(3, noise_db=0.1)) for _ in range(2))
    assert one.trials == other.trials


def test_objects_that_are_shared_are_paid_for_once() -> None:
    landscape = Landscape(1, noise_db=0.0)
    found = search(AXES, RUNGS, 99.0, landscape)
    assert found.reached is None and found.spent_s < sum(trial.tried.cost_s for trial in found.trials)
    assert found.found is not None and found.found.psnr_db == max(trial.psnr_db for trial in found.trials)


def test_what_fails_is_not_trained_further_and_all_failing_finds_nothing() -> None:
    found = search(AXES, RUNGS, 20.0, lambda settings, steps: Tried(None, {settings: 1.0}, 0.0))
    assert found.found is None and {trial.steps for trial in found.trials} == {RUNGS[0]}
    assert Search(20.0).spent_s == 0.0
