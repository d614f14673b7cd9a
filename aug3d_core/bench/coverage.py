"""What ways of sampling reach of the town's surface, with how many views, and what choosing among candidates saves."""

from __future__ import annotations

from aug3d_core.bench.figure import Figure, at_most, told
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial

METHODS = ("spiral", "dome", "grid", "buildings")
SEEDS = range(3)
FIGURES = {
    "views_planned": "views",
    "reach_share": "share",
    "uniform_views": "views",
    "uniform_reach_share": "share",
    "sampling_over_finest_ratio": "ratio",
    "overlap_in_dome_share": "share",
}


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return the views that the choice needs over uniform sampling's, and for each method what it plans and reaches.

    Shares are of surface points from a direction at a fineness, and the same for every method. `uniform` is the method's
    domes as drawn; without it, what is kept of its candidates.
    """
    answer: dict[str, Figure] = {}
    for method in METHODS:
        trial = run_trial(store, "sampling", scene, (f"sampling.method={method}",), directly(store, say))
        for name, unit in FIGURES.items():
            answer[f"sampling_{method}_{name}"] = Figure(told(trial, "sampling", name), unit, failure=trial.failure)
        seconds = trial.seconds(("sampling",)) if "sampling" in trial.records else None
        answer[f"sampling_{method}_seconds"] = Figure(seconds, "s", failure=trial.failure)
    return {"coverage_views_ratio": _worst_ratio(store, scene, say)} | answer


def _worst_ratio(store: Store, scene: Measured, say: Say) -> Figure:
    """Return the ratio of the seed at which the choice saves least."""
    trials = [
        run_trial(store, "sampling", scene, ("sampling.method=grid", f"sampling.seed={s}"), directly(store, say))
        for s in SEEDS
    ]
    ratios = [told(trial, "sampling", "coverage_views_ratio") for trial in trials]
    known = [ratio for ratio in ratios if ratio is not None]
    return at_most(0.5, max(known) if len(known) == len(SEEDS) else None, "ratio")
