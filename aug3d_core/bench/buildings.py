"""Building boxes against the true ones: on the town's gentle hills, and on a slope.

Where `sampling.sam_weights` is set, those of Segment Anything are measured too: the sun of the town casts shadows, which
lead that method astray.
"""

from __future__ import annotations

from dataclasses import dataclass

from aug3d_core.bench.figure import Figure, at_least
from aug3d_core.domes.boxes import Buildings
from aug3d_core.domes.building_chart import draw_buildings
from aug3d_core.domes.files import BUILDINGS
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.town.files import TRUTH_FOOTPRINTS
from aug3d_core.town.truth.building_boxes import read_footprints, score_boxes, true_boxes
from aug3d_core.town.truth.pose_errors import true_from_found
from aug3d_core.town.truth.true_views import true_views


@dataclass(frozen=True)
class Land:
    """A town to find buildings in and how, and the least F1 at an intersection over union of 0.5, if there is a goal."""

    name: str
    overrides: tuple[str, ...]
    goal: float | None


_BUILDINGS, _SAM = "sampling.method=buildings", "sampling.method=sam"
_SLOPE = ("town.terrain=slope", "town.slope_deg=10")
LANDS = (Land("flat", (_BUILDINGS,), 0.8), Land("slope10", (_BUILDINGS, *_SLOPE), 0.7))
SAM_LANDS = (Land("sam_flat", (_SAM,), None), Land("sam_slope10", (_SAM, *_SLOPE), None))


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return how well boxes are found, and what the sampling took; pictures lie beside the benchmark's figures."""
    found: dict[str, Figure] = {}
    for land in (*LANDS, *(SAM_LANDS if scene.config().sampling.sam_weights else ())):
        trial = run_trial(store, "sampling", scene, land.overrides, directly(store, say))
        found |= land_figures(store, trial, land)
    return found


def land_figures(store: Store, trial: Trial, land: Land) -> dict[str, Figure]:
    """Return one town's figures, and draw its true boxes beside the found ones."""
    key = f"building_f1_{land.name}"
    if "sampling" not in trial.records:
        return {key: _unmeasured(land, trial.failure)}
    folders = {name: store.files_dir(trial.records[name]) for name in ("town", "sfm", "sampling")}
    if not (folders["sampling"] / BUILDINGS).exists():
        return {key: _unmeasured(land, "no ground was found to measure heights from")}
    found = Buildings.load(folders["sampling"] / BUILDINGS)
    views, truth = Views.load(folders["sfm"] / VIEWS), true_views(folders["town"], folders["sfm"])
    outlines = read_footprints(folders["town"] / TRUTH_FOOTPRINTS)
    asked, allowed = true_boxes(outlines, true_from_found(views, truth), found)
    pictures = store.root / layout.BENCH_PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    draw_buildings(found, pictures / f"buildings_{land.name}.png", asked)
    score = score_boxes(found.boxes, asked, allowed)
    return {
        key: Figure(score.f1, "share") if land.goal is None else at_least(land.goal, score.f1, "share"),
        f"building_precision_{land.name}": Figure(score.precision, "share"),
        f"building_recall_{land.name}": Figure(score.recall, "share"),
        f"building_sampling_seconds_{land.name}": Figure(trial.seconds(("sampling",)), "s"),
    }


def _unmeasured(land: Land, failure: str) -> Figure:
    return Figure(None, "share", land.goal, None if land.goal is None else False, failure)
