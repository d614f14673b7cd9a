"""No more domes than the scene needs: of many candidates, those that show surface from directions not seen before.

What the training photographs see counts as seen: they are in the data set beside the renders, and are the better
pictures. A fine view of a place counts more than a coarse one, by its pixels. A dome's K views are one training group,
so domes are taken whole: first the K of its cameras that show most together, then dome after dome. The next one must add
`min_gain` of what a dome shows on average, or none is taken any more; where photographs have seen all, that is no dome
at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.domes.cameras import Cameras, Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.greedy import added, greedy
from aug3d_core.domes.reach import Curve, Reach, union
from aug3d_core.domes.sight import Sights

NEARLY = 0.95  # of what uniform sampling adds


@dataclass(frozen=True)
class Choice:
    """A plan of K views on each dome, and what it reaches, view by view in the order of the choice, beyond its stop too."""

    plan: Plan
    views: tuple[tuple[Sights, ...], ...]  # what each view sees, by dome
    curve: Curve
    domes: int


def as_drawn(plan: Plan, seen: Sequence[Sequence[Sights]], k: int, reach: Reach) -> Choice:
    """Keep all domes of a plan with the first K of their cameras: uniform sampling."""
    views = tuple(tuple(dome[:k]) for dome in seen)
    picks = [np.arange(k)] * len(seen)
    kept = np.ones(len(seen), bool)
    return Choice(
        _thinned(plan, picks, kept, "", k), views, reach.curve([v for dome in views for v in dome]), len(views)
    )


def by_coverage(plan: Plan, seen: Sequence[Sequence[Sights]], k: int, reach: Reach, config: SamplingConfig) -> Choice:
    """Keep the cameras and domes of a plan that add most to what the photographs see."""
    picks = [_best_views(views, k, reach.photographed, reach.worth) for views in seen]
    shown = [_shown(views, pick) for views, pick in zip(seen, picks, strict=True)]
    worth = config.min_gain * float(np.mean([reach.worth[sights].sum() for sights in shown] or [0.0]))
    order, covered, gains = [], reach.photographed.copy(), []
    for dome, _ in greedy(shown, covered.copy(), reach.worth):
        # Now that it is known what comes before, other cameras of the dome may add more
        picks[dome] = _best_views(seen[dome], k, covered, reach.worth)
        shown[dome] = _shown(seen[dome], picks[dome])
        gains.append(added(shown[dome], covered, reach.worth))
        covered[shown[dome]] = True
        order.append(dome)
    worthwhile = [gain > 0 and gain >= worth for gain in gains[: config.domes]] + [False]
    count = worthwhile.index(False)
    kept = np.isin(np.arange(len(seen)), order[:count])
    left_out = "left out: adds too little" if count < config.domes else "left out: others add more"
    return Choice(
        _thinned(plan, picks, kept, left_out, k),
        tuple(tuple(seen[dome][view] for view in picks[dome]) for dome in np.flatnonzero(kept)),
        reach.curve([seen[dome][view] for dome in order for view in picks[dome]]),
        count,
    )


def views_ratio(chosen: Curve, uniform: Curve) -> float | None:
    """Return the views needed for nearly all that uniform sampling adds to photographs, over uniform sampling's views.

    None where uniform sampling adds nothing, or where the choice never gets there.
    """
    added = uniform.sights - uniform.sights[0]
    enough = chosen.sights - chosen.sights[0] >= NEARLY * added[-1]
    return int(enough.argmax()) / (len(added) - 1) if added[-1] > 0 and enough.any() else None


def together(first: Plan, second: Plan) -> Plan:
    """Return one plan with the domes of two."""
    shift = {"view_id": len(first.cameras), "dome_id": int(first.cameras.dome_id.max(initial=-1)) + 1}
    arrays = {
        name: np.concatenate([getattr(first.cameras, name), getattr(second.cameras, name) + shift.get(name, 0)])
        for name in ("view_id", "dome_id", "world_from_cam", "intrinsics", "size")
    }
    return replace(first, cameras=Cameras(**arrays), domes=first.domes + second.domes)


def _shown(views: Sequence[Sights], pick: Int[np.ndarray, " k"]) -> Sights:
    return union([views[view] for view in pick])


def _best_views(
    views: Sequence[Sights], k: int, covered: Bool[np.ndarray, " u"], worth: Float[np.ndarray, " u"]
) -> Int[np.ndarray, " k"]:
    """Return the K views of a dome that together add most to what is covered, the one that adds most first."""
    chosen = [index for index, _ in islice(greedy(views, covered.copy(), worth), k)]
    return np.array(chosen)


def _thinned(
    plan: Plan, picks: Sequence[Int[np.ndarray, " k"]], kept: Bool[np.ndarray, " d"], why: str, k: int
) -> Plan:
    """Return a plan with some cameras of some domes; `why` is added to what is said of the others."""
    cameras, used = plan.cameras, np.flatnonzero(np.array([dome.views > 0 for dome in plan.domes], bool))
    first = np.searchsorted(cameras.dome_id, np.arange(len(picks)))
    rows = np.concatenate([np.zeros(0, int), *(first[d] + picks[d] for d in np.flatnonzero(kept))])
    domes = list(plan.domes)
    for position, keep in zip(used, kept, strict=True):
        dome = domes[position]
        domes[position] = replace(dome, views=k) if keep else replace(dome, views=0, why=f"{dome.why}; {why}")
    thinned = Cameras(
        view_id=np.arange(len(rows)),
        dome_id=np.repeat(np.arange(kept.sum()), k),
        world_from_cam=cameras.world_from_cam[rows],
        intrinsics=cameras.intrinsics[rows],
        size=cameras.size[rows],
    )
    return replace(plan, cameras=thinned, domes=tuple(domes))
