"""Bad members of every way of grouping: on every flight path over the town, and on the paper's edge cases.

A member is bad when it sees less than 10 % of the surface that the group's centre sees, or the other way round, in the mean:
`overlap/measures.py` states it. Everything is exact: the true mesh, seen from the true poses.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import get_args

from aug3d_core.bench.figure import Figure, at_least, at_most, told
from aug3d_core.groups.methods import METHODS
from aug3d_core.overlap.comparison import BEST
from aug3d_core.overlap.files import GROUPS_COLUMNS, GROUPS_MAP
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.edge_case_trial import draw_cases, try_case
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.town.config import FlightPath
from aug3d_core.town.truth.edge_cases import edge_cases

PATHS: tuple[str, ...] = get_args(FlightPath)
OURS = "shared"
MOST_BAD = 0.05  # of our members, on every path
CASES_PICTURE = "edge_cases.png"
_FAILS = 0.2  # bad members from which a way counts as failing


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return for each way the share of bad members at K = 10: over the worst path, path by path, and on the edge cases."""
    pictures = store.root / layout.BENCH_PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    trials = {path: run_trial(store, "overlap", scene, (f"town.path={path}",), directly(store, say)) for path in PATHS}
    for path, trial in trials.items():
        _keep_pictures(store, trial, pictures, path)
    return path_figures(trials) | edge_case_figures(pictures)


def path_figures(trials: dict[str, Trial]) -> dict[str, Figure]:
    """Return the figures of flights over the town, by path; a path that failed leaves no figure of the worst path."""
    shares = {way: {path: _bad(trial, way) for path, trial in trials.items()} for way in (*METHODS, BEST)}
    failure = "; ".join(f"{path}: {trial.failure}" for path, trial in trials.items() if trial.failure)
    found: dict[str, Figure] = {}
    for way, by_path in shares.items():
        values = [value for value in by_path.values() if value is not None]
        worst = max(values) if len(values) == len(trials) else None
        found[f"bad_members_{way}_k10"] = (
            at_most(MOST_BAD, worst, "share") if way == OURS else Figure(worst, "share", failure=failure)
        )
        found |= {f"bad_members_{way}_k10_{path}": Figure(value, "share") for path, value in by_path.items()}
    for way in METHODS:
        if way != OURS:
            found |= _against(way, shares[OURS], shares[way])
    return found


def _against(way: str, ours: dict[str, float | None], theirs: dict[str, float | None]) -> dict[str, Figure]:
    """Count the paths on which shared points have fewer bad members than another way, and more; the rest are ties.

    A way that refuses a path, or cannot group it, counts as neither.
    """
    pairs = [(a, b) for a, b in zip(ours.values(), theirs.values(), strict=True) if a is not None and b is not None]
    return {
        f"paths_{OURS}_fewer_bad_than_{way}_k10": at_least(len(ours), sum(a < b for a, b in pairs), "paths"),
        f"paths_{OURS}_more_bad_than_{way}_k10": at_most(0, sum(a > b for a, b in pairs), "paths"),
    }


def edge_case_figures(pictures: Path) -> dict[str, Figure]:
    """Return, for each edge case, how bad the ways that should fail are, and shared points; and draw them."""
    cases = [try_case(case) for case in edge_cases()]
    draw_cases(cases, pictures / CASES_PICTURE)
    found: dict[str, Figure] = {}
    for tried in cases:
        for way in tried.members:
            key = f"edge_{tried.case.key}_bad_members_{way}"
            share = tried.bad_share(way)
            fails, ours = way in tried.case.fails, way == OURS
            found[key] = (
                at_least(_FAILS, share, "share") if fails
                else at_most(MOST_BAD, share, "share") if ours
                else Figure(share, "share")
            )  # fmt: skip
    return found


def _bad(trial: Trial, way: str) -> float | None:
    return told(trial, "overlap", f"bad_members_{way}_k10")


def _keep_pictures(store: Store, trial: Trial, pictures: Path, path: str) -> None:
    if "overlap" in trial.records:
        for name in (GROUPS_MAP, GROUPS_COLUMNS):
            shutil.copy(store.file(trial.records["overlap"], name), pictures / f"{path}_{name}")
