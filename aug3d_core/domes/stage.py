"""The sampling stage: plan the virtual cameras that the renderer will use."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.domes.building_chart import draw_buildings
from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.chart import draw_coverage, draw_map
from aug3d_core.domes.choice import Choice, as_drawn, by_coverage, together
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.decisions import decisions
from aug3d_core.domes.files import BUILDINGS, BUILDINGS_MAP, CAMERAS, COVERAGE_CHART, DOME_TABLE, SAMPLING_MAP
from aug3d_core.domes.methods import METHODS
from aug3d_core.domes.place import plan_of
from aug3d_core.domes.reach import Reach
from aug3d_core.domes.read import read_mesh, train_photos, views_per_dome
from aug3d_core.domes.report import dome_table, figures, remarks, tally, warnings, worst_views
from aug3d_core.domes.site import Site, site_of
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.surface.files import TEXTURED_MESH

EASED = (1.0, 0.75, 0.5)  # of the covered shares asked for, tried in turn until a dome stands
DRAWN, MORE = 3, 2  # candidates over what is wanted: cameras on a dome, and further domes
STEPS = 4


def run(inputs: Inputs, config: SamplingConfig, out: Path, progress: Progress) -> Outcome:
    """Plan domes over the mesh that was made of train photos."""
    progress(0, STEPS, "looking at the mesh from above")
    mesh, photos = read_mesh(inputs), train_photos(inputs)
    surface = Raycaster(mesh.xyz, mesh.triangles)
    by_choice = config.choice == "coverage"
    textured = (inputs["surface"] / TEXTURED_MESH).exists()
    wanted = views_per_dome(inputs, config)
    site = site_of(mesh, surface, photos, config, textured, wanted, DRAWN * wanted if by_choice else wanted)
    progress(1, STEPS, "placing cameras")
    planned, eased = _plan(surface, site, config)
    progress(2, STEPS, "looking through the cameras")
    reach = Reach(mesh, surface, photos, site, np.random.default_rng(config.seed))
    kept, uniform = _choose(planned, surface, site, config, eased, reach)
    progress(3, STEPS, "writing")
    kept.plan.cameras.save(out / CAMERAS)
    dome_table(kept.plan).to_parquet(out / DOME_TABLE, index=False)
    draw_map(kept.plan, site.ground, out / SAMPLING_MAP)
    draw_coverage(kept, uniform, out / COVERAGE_CHART)
    pictures = {
        "Domes and virtual cameras over the mesh": SAMPLING_MAP,
        "Surface reached by virtual views": COVERAGE_CHART,
    }
    if planned.buildings is not None:
        planned.buildings.save(out / BUILDINGS)
        draw_buildings(planned.buildings, out / BUILDINGS_MAP)
        pictures["Buildings in the surface seen from above"] = BUILDINGS_MAP
    progress(STEPS, STEPS, "done")
    metrics = figures(kept, uniform, reach, site) | worst_views(kept.plan, surface, site) | tally(kept.plan)
    metrics["min_view_covered"] = eased * config.min_view_covered
    warned = (*planned.notes, *warnings(planned, metrics, config, eased))
    return Outcome(
        metrics=metrics,
        state="degraded" if warned else "ok",
        notes=warned + remarks(planned, kept, config),
        pictures=pictures,
        decisions=tuple(decisions(metrics, config)),
    )


def _plan(surface: Raycaster, site: Site, config: SamplingConfig) -> tuple[Plan, float]:
    """Plan domes; over a surface so patchy that none stands, ask for less of it. Return the share asked for too.

    A hole in a rendered view does no harm: the data set masks it.
    """
    if not config.domes:
        return plan_of([], site), 1.0
    for eased in EASED:
        planned = METHODS[config.method](surface, site, _easier(config, eased), np.random.default_rng(config.seed))
        if len(planned.cameras):
            break
    return planned, eased


def _easier(config: SamplingConfig, eased: float) -> SamplingConfig:
    return config.model_copy(
        update={name: eased * getattr(config, name) for name in ("min_cell_covered", "min_view_covered")}
    )


def _choose(
    planned: Plan, surface: Raycaster, site: Site, config: SamplingConfig, eased: float, reach: Reach
) -> tuple[Choice, Choice]:
    """Return what is kept, and what uniform sampling keeps: all domes of the plan, with the first of their cameras."""
    k = site.views_per_dome
    seen = reach.of_domes(planned.cameras)
    uniform = as_drawn(planned, seen, k, reach)
    if config.choice == "uniform" or not len(planned.cameras):
        return uniform, uniform
    wider = _easier(config, eased).model_copy(update={"domes": MORE * config.domes})
    more = METHODS[config.method](surface, site, wider, np.random.default_rng(config.seed + 1))
    candidates = together(planned, more)
    return by_coverage(candidates, seen + reach.of_domes(more.cameras), k, reach, config), uniform
