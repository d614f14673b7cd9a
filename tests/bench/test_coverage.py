import pytest

from aug3d_core.bench import coverage
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Trial


def with_ratios(monkeypatch: pytest.MonkeyPatch, ratios: dict[str, float | None]) -> dict:
    """Return the figures where the trials of each seed tell these ratios."""

    def run_trial(store, until, scene, overrides, say):
        metrics = dict.fromkeys(coverage.FIGURES, 0.5)
        metrics["coverage_views_ratio"] = ratios.get(overrides[-1])
        if overrides[0] == "sampling.method=dome":
            return Trial({}, "it failed")
        return Trial({"sampling": Record.model_construct(stage="sampling", metrics=metrics, seconds=3.0)})

    monkeypatch.setattr(coverage, "run_trial", run_trial)
    return coverage.figures(object.__new__(Store), Measured("tiny"), print)


def test_the_ratio_is_that_of_the_worst_seed(monkeypatch):
    figures = with_ratios(monkeypatch, {f"sampling.seed={s}": ratio for s, ratio in enumerate((0.3, 0.45, 0.4))})
    assert figures["coverage_views_ratio"].value == 0.45 and figures["coverage_views_ratio"].holds
    assert figures["sampling_grid_reach_share"].value == 0.5 and figures["sampling_grid_seconds"].value == 3.0
    assert figures["sampling_dome_seconds"].value is None and figures["sampling_dome_seconds"].failure == "it failed"


def test_a_seed_without_a_ratio_does_not_reach_the_goal(monkeypatch):
    figures = with_ratios(monkeypatch, {"sampling.seed=0": 0.3, "sampling.seed=1": 0.3, "sampling.seed=2": None})
    assert figures["coverage_views_ratio"].value is None and figures["coverage_views_ratio"].holds is False
