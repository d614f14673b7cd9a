"""The finder of buildings on villages that are known exactly: cells that need no stage of the factory.

The state is what the sampling stage reports of the places of domes: where no building is found, it says so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from aug3d_core.domes.building_chart import draw_buildings
from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.files import BUILDINGS_MAP
from aug3d_core.domes.methods import buildings
from aug3d_core.domes.report import FEW_DOMES
from aug3d_core.domes.site import site_of
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.run.stage import Metric, Outcome
from aug3d_core.studies.stability.box_world import Village, slope, terrace, village
from aug3d_core.town.truth.building_boxes import score_boxes

BOX_F1, OVER_GRID = "box_f1", "houses_per_box_over_grid"
DIVIDED, PERCENTILE = "between low and high", "the 80th percentile"  # where the plane cuts buildings off
_CUTS = {DIVIDED: None, PERCENTILE: 80.0}
_HOUSES, _TREES = 12, 12
NO_BOXES = np.zeros((0, 4))
_VIEWS = 4  # on a dome: the boxes are judged, not the domes over them


def on_slope(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Let the ground rise by so many degrees."""
    return _find(village(_HOUSES, _TREES, 0, slope(dose), np.random.default_rng(seed)), method, seed, out)


def on_terraces(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Let half of the village stand so many metres higher."""
    return _find(village(_HOUSES, _TREES, 0, terrace(dose), np.random.default_rng(seed)), method, seed, out)


def among_trees(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Plant so many trees in leaf."""
    return _find(village(_HOUSES, round(dose), 0, slope(0.0), np.random.default_rng(seed)), method, seed, out)


def among_bare_trees(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Plant so many trees without leaves."""
    return _find(village(_HOUSES, 0, round(dose), slope(0.0), np.random.default_rng(seed)), method, seed, out)


def few_houses(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Take away so many of the houses."""
    left = _HOUSES - round(dose)
    return _find(village(left, _TREES, 0, slope(0.0), np.random.default_rng(seed)), method, seed, out)


def _find(true: Village, method: str, seed: int, out: Path) -> Outcome:
    surface = Raycaster(true.mesh.xyz, true.mesh.triangles)
    config = SamplingConfig(method="buildings", slice_percentile=_CUTS[method], seed=seed)
    site = site_of(true.mesh, surface, true.photos, config, True, _VIEWS, _VIEWS)
    planned = buildings.plan(surface, site, config, np.random.default_rng(seed))
    found, notes = planned.buildings, (*planned.notes, *_few_domes(planned, config))
    boxes = NO_BOXES if found is None else found.boxes
    pictures = {}
    if found is not None:
        draw_buildings(found, out / BUILDINGS_MAP, true.boxes)
        pictures["Boxes found, and the true ones"] = BUILDINGS_MAP
    return Outcome(metrics=_figures(boxes, true), state="degraded" if notes else "ok", notes=notes, pictures=pictures)


def _few_domes(planned: Plan, config: SamplingConfig) -> tuple[str, ...]:
    standing = sum(dome.views > 0 for dome in planned.domes)
    few = standing < FEW_DOMES * config.domes
    return (f"only {standing} of {config.domes} domes wanted found a place over the mesh",) if few else ()


def _figures(found: Float[np.ndarray, "n 4"], true: Village) -> dict[str, Metric]:
    """Return the F1 of found boxes, and how many of them hold a house, over the share of the ground under houses.

    The second is what boxes are for: domes of a grid would meet houses by chance. Where there is nothing to find, both
    are 1 if nothing is found.
    """
    counts = {"boxes": len(found), "houses": len(true.boxes)}
    if not len(true.boxes):
        right = float(not len(found))
        return {BOX_F1: right, OVER_GRID: right, **counts}
    score, low, high = score_boxes(found, true.boxes, NO_BOXES), *np.sort(true.mesh.xyz[:, :2], axis=0)[[0, -1]]
    built = (true.boxes[:, 2:] - true.boxes[:, :2]).prod(axis=1).sum() / (high - low).prod()
    return {BOX_F1: score.f1, OVER_GRID: float(score.precision / built), **counts}
