"""The paper's edge cases of grouping at growing dose: cells that need no stage of the factory.

The worlds are known exactly, so that the share of bad members is exact too. The state is what the grouping stage would
report: it sees the shared points alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.groups.audit import apart_shares, group_doubts
from aug3d_core.groups.methods import METHODS
from aug3d_core.run.stage import Metric, Outcome
from aug3d_core.studies.common.edge_case_trial import draw_worst, try_case
from aug3d_core.town.truth.edge_cases import EdgeCase, K, abrupt_turn, high_rise, looking_apart, shaken

BAD_MEMBERS = "bad_members_share"
_PICTURE = "worst_group.png"


def turns(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Fly so many turns within as many photographs as a group has."""
    return _group(abrupt_turn(round(K / dose)), method, seed, out)


def apart(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Look so many degrees away from straight down, into rings that cross."""
    return _group(looking_apart(dose), method, seed, out)


def height(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Fly about buildings of so many metres."""
    return _group(high_rise(dose), method, seed, out)


def _group(case: EdgeCase, method: str, seed: int, out: Path) -> Outcome:
    tried = try_case(shaken(case, np.random.default_rng(seed)), {method: METHODS[method]})
    figures: dict[str, Metric] = {
        BAD_MEMBERS: tried.bad_share(method),
        **apart_shares(tried.scene, tried.members[method]),
    }
    doubts = group_doubts(figures)
    draw_worst(tried, method, out / _PICTURE)
    return Outcome(
        metrics=figures,
        state="degraded" if doubts else "ok",
        notes=tuple(doubts),
        pictures={f"The worst group of {method}, its centre first": _PICTURE},
    )
