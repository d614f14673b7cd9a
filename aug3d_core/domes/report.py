"""What the sampling stage tells: figures, the table of domes, and what the user should know."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import pandas as pd

from aug3d_core.domes.cameras import Dome, Plan
from aug3d_core.domes.choice import Choice, views_ratio
from aug3d_core.domes.conditioning import lacks
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.reach import Reach
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import invert
from aug3d_core.run.stage import Metric

FEW_DOMES = 0.5  # of those wanted: below this the outcome is degraded


def dome_table(planned: Plan) -> pd.DataFrame:
    """Return one row per place; `dome_id` is -1 where no dome stands, `rejected_*` count cameras that were no use."""
    names = [field.name for field in fields(Dome)]
    rows = pd.DataFrame(
        [vars(dome) | _rejected(dome.rejected) for dome in planned.domes] or {name: [] for name in names}
    )
    used = rows["views"] > 0
    rows.insert(0, "dome_id", np.where(used, used.cumsum() - 1, -1))
    return rows.drop(columns="rejected")


def figures(kept: Choice, uniform: Choice, reach: Reach, site: Site) -> dict[str, Metric]:
    """Return what is planned and what it reaches, beside uniform sampling."""
    used = [dome for dome in kept.plan.domes if dome.views]
    places = kept.plan.cameras.world_from_cam[:, :3, 3]
    aims = np.repeat([[dome.x, dome.y, dome.z] for dome in used], site.views_per_dome, axis=0).reshape(-1, 3)
    sampling = np.linalg.norm(places - aims, axis=1) / site.focal_px
    cells = [dome.cell for dome in used]
    return {
        "views_planned": len(places),
        "domes": len(used),
        "views_per_dome": site.views_per_dome,
        "places_passed_over": len(kept.plan.domes) - len(used),
        "cell_finest_world_units": round(min(cells), 4) if used else None,
        "cell_coarsest_world_units": round(max(cells), 4) if used else None,
        "relief_world_units": round(site.relief, 4),
        "relief_over_cell_ratio": round(site.relief / float(np.median(cells)), 4) if used else None,
        "sampling_over_finest_ratio": round(float(np.median(sampling)) / site.finest_sampling, 3) if used else None,
        "hfov_deg": round(float(2 * np.degrees(np.arctan(site.size[0] / 2 / site.focal_px))), 2),
        "overlap_in_dome_share": reach.overlap(kept.views),
        "photos_reach_share": float(kept.curve.sights[0]),
        "reach_share": float(kept.curve.sights[len(places)]),
        "uniform_views": len(uniform.plan.cameras),
        "uniform_reach_share": float(uniform.curve.sights[-1]),
        "coverage_views_ratio": None if kept is uniform else views_ratio(kept.curve, uniform.curve),
    }


def worst_views(planned: Plan, surface: Raycaster, site: Site) -> dict[str, Metric]:
    """Return what the worst of the kept views lack, judged on all of their pixels."""
    shares = lacks(surface, invert(planned.cameras.world_from_cam[:, :3]), site, site.size)
    worst = shares.max(axis=0) if len(shares) else np.zeros(4)
    names = ("empty", "back_faces", "black", "smeared")
    return {f"worst_view_{name}_share": round(float(share), 5) for name, share in zip(names, worst, strict=True)}


def tally(planned: Plan) -> dict[str, int]:
    """Return how many cameras were tried, and how many were rejected for each reason."""
    total = Counter()
    for dome in planned.domes:
        total.update({"cameras_tried": dome.tried} | _rejected(dome.rejected))
    return dict(total)


def _rejected(rejected: Mapping[str, int]) -> dict[str, int]:
    return {f"rejected_{reason}": count for reason, count in rejected.items()}


def warnings(planned: Plan, figures: Mapping[str, Metric], config: SamplingConfig, eased: float) -> tuple[str, ...]:
    """Return what went wrong; `eased` is the share asked for of what the settings ask for."""
    if not config.domes:
        return ()
    standing, covered = sum(dome.views > 0 for dome in planned.domes), 100 * config.min_view_covered
    if not standing:
        return (
            f"no dome stands on any of {len(planned.domes)} places ({_commonest(planned)}), so that there are no virtual "
            "views: lower sampling.min_view_covered or sampling.min_cell_covered, or take more photos",
        )
    notes = []
    if eased < 1:
        notes.append(
            f"the surface is patchy: a view may stand where {eased * covered:.0f} % of it shows surface, "
            f"not {covered:.0f} %"
        )
    if standing < FEW_DOMES * config.domes:
        notes.append(f"only {standing} of {config.domes} domes wanted found a place over the mesh")
    allowed = {"empty": 1 - eased * config.min_view_covered, "back_faces": config.max_back_faces}
    for name, share in allowed.items():
        worst = float(figures[f"worst_view_{name}_share"] or 0)
        if worst > share:
            notes.append(f"a view has {100 * worst:.0f} % of {name.replace('_', ' ')}; {100 * share:.0f} % are allowed")
    return tuple(notes)


def remarks(planned: Plan, kept: Choice, config: SamplingConfig) -> tuple[str, ...]:
    """Return what is good to know where nothing went wrong."""
    if not config.domes:
        return ("no virtual views are wanted (sampling.domes is 0)",)
    if len(planned.cameras) and not kept.domes:
        reached = 100 * float(kept.curve.points[0])
        return (
            f"no virtual views are needed: the photos show {reached:.0f} % of the surface, and no dome adds "
            f"{100 * config.min_gain:.0f} % of what it shows (sampling.min_gain)",
        )
    return ()


def _commonest(planned: Plan) -> str:
    """Return the reason for which most cameras were rejected, or most places before any camera was tried."""
    reasons = Counter({reason: count for reason, count in tally(planned).items() if reason.startswith("rejected_")})
    if reasons.total():
        reason, count = reasons.most_common(1)[0]
        return f"{count} of {tally(planned)['cameras_tried']} cameras: {reason.removeprefix('rejected_').replace('_', ' ')}"
    return planned.domes[0].why
