"""The sampling stage: plan the virtual cameras that the renderer will use."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.errors import InputError
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.sampling.cameras import Plan
from aug3d_core.sampling.chart import draw_map
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sampling.grid import plan
from aug3d_core.sampling.ground import ground_of
from aug3d_core.sampling.site import Site, edge_length, lens_like, photo_sampling
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout
from aug3d_core.surface.raycast import Raycaster

EASED = (1.0, 0.75, 0.5)  # of the covered shares asked for, tried in turn until a dome stands
FEW_DOMES = 0.5  # of those wanted: below this the outcome is degraded


def run(inputs: Inputs, config: SamplingConfig, out: Path, progress: Progress) -> Outcome:
    """Plan domes over the mesh that was made of train photos."""
    lowest, highest = config.min_elevation_deg, config.max_elevation_deg
    if lowest > highest:
        raise InputError(
            f"sampling.min_elevation_deg {lowest} is above sampling.max_elevation_deg {highest}",
            "set the lowest elevation below the highest",
        )
    progress(0, 2, "looking at the mesh from above")
    mesh = Mesh.load(inputs["surface"] / layout.MESH)
    surface = Raycaster(mesh.xyz, mesh.triangles)
    site = _site(inputs, mesh, surface, config)
    progress(1, 2, "placing cameras")
    planned, eased = _plan(surface, site, config)
    if not len(planned.cameras):
        raise InputError(
            f"no dome stands on any of {len(planned.domes)} cells: {planned.domes[0].why}",
            "lower sampling.min_view_covered or sampling.min_cell_covered, or take more photos",
        )
    planned.cameras.save(out / layout.CAMERAS)
    dome_table(planned).to_parquet(out / layout.DOME_TABLE, index=False)
    draw_map(planned, site.ground, out / "map.png")
    progress(2, 2, "done")
    figures = _figures(planned, site)
    figures["min_view_covered"] = eased * config.min_view_covered
    notes = _notes(figures, config, eased)
    return Outcome(
        metrics=figures,
        state="degraded" if notes else "ok",
        notes=notes,
        pictures={"Domes and virtual cameras over the mesh": "map.png"},
    )


def _plan(surface: Raycaster, site: Site, config: SamplingConfig) -> tuple[Plan, float]:
    """Plan domes; over a surface so patchy that none stands, ask for less of it. Return the share asked for too.

    A hole in a rendered view does no harm: the data set masks it.
    """
    for eased in EASED:
        asked = {name: eased * getattr(config, name) for name in ("min_cell_covered", "min_view_covered")}
        planned = plan(surface, site, config.model_copy(update=asked), np.random.default_rng(config.seed))
        if len(planned.cameras):
            break
    return planned, eased


def dome_table(planned: Plan) -> pd.DataFrame:
    """Return one row per cell; `dome_id` is -1 where no dome stands."""
    rows = pd.DataFrame([asdict(dome) for dome in planned.domes])
    used = rows["views"] > 0
    rows.insert(0, "dome_id", np.where(used, used.cumsum() - 1, -1))
    return rows


def _site(inputs: Inputs, mesh: Mesh, surface: Raycaster, config: SamplingConfig) -> Site:
    """Gather what the sampler may know; the lens and the sampling are those of train photos."""
    views = Views.load(inputs["sfm"] / layout.VIEWS)
    split = pd.read_parquet(inputs["grouping"] / layout.SPLIT_TABLE)
    train = views.take(np.sort(split["view"].to_numpy()[split["role"].astype(str) == "train"]))
    size = np.array([config.width_px, config.height_px])
    wanted = config.views_per_dome
    if wanted is None:
        with np.load(inputs["grouping"] / layout.GROUPS, allow_pickle=False) as groups:
            wanted = groups["members"].shape[1]
    # Colours at vertices are as coarse as the triangles; a texture is as fine as the photos, however few triangles there are
    grain = 0.0 if (inputs["surface"] / layout.TEXTURED_MESH).exists() else edge_length(mesh)
    finest = max(config.min_sampling_ratio * photo_sampling(train, mesh, size), grain)
    return Site(ground_of(mesh, surface), lens_like(train, size), size, finest, int(wanted))


def _figures(planned: Plan, site: Site) -> dict:
    used = [dome for dome in planned.domes if dome.views]
    sampling = used[0].radius / site.focal_px
    return {
        "views_planned": len(planned.cameras),
        "domes": len(used),
        "views_per_dome": site.views_per_dome,
        "cells_skipped": len(planned.domes) - len(used),
        "cell_world_units": round(used[0].cell, 4),
        "radius_median_world_units": round(float(np.median([dome.radius for dome in used])), 4),
        "sampling_over_finest_ratio": round(sampling / site.finest_sampling, 3),
        "hfov_deg": round(float(2 * np.degrees(np.arctan(site.size[0] / 2 / site.focal_px))), 2),
    }


def _notes(figures: dict, config: SamplingConfig, eased: float) -> tuple[str, ...]:
    notes = []
    if eased < 1:
        notes.append(
            f"the surface is patchy: a view may stand where {100 * figures['min_view_covered']:.0f} % of it shows surface, "
            f"not {100 * config.min_view_covered:.0f} %"
        )
    if figures["domes"] < FEW_DOMES * config.domes:
        notes.append(f"only {figures['domes']} of {config.domes} domes wanted found a place over the mesh")
    return tuple(notes)
