"""The overlap stage: how much of the same surface the members of groups really see, for every way of grouping.

Here by rays on the reconstructed mesh, the one made without the test's targets; `aug3d_core/town/truth/overlap_stage.py` does
the same on the true town.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views
from aug3d_core.groups.audit import MANY_APART
from aug3d_core.groups.files import GROUPS
from aug3d_core.groups.methods import METHODS
from aug3d_core.groups.read_scene import read_scene
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.overlap.columns import draw_columns, photo_file
from aug3d_core.overlap.comparison import (
    BEST,
    OWN,
    SIZES,
    TEST,
    Comparison,
    Grouped,
    compare,
    member_table,
    summary_table,
)
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.overlap.files import GROUPS_COLUMNS, GROUPS_MAP, OVERLAP_MEMBERS, OVERLAP_TABLE
from aug3d_core.overlap.group_map import draw_groups
from aug3d_core.overlap.places import groups_at_places
from aug3d_core.overlap.true_overlap import true_overlaps
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.sfm.files import VIEW_IMAGES
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import Role
from aug3d_core.surface.files import BASELINE_MESH

_MANY_UNJUDGED = 0.5  # the figures then speak of the smaller part
_PLACES_ON_MAP, _PLACES_IN_COLUMNS = 6, 2
_QUALITY = 88  # of a JPEG


def run(inputs: Inputs, config: OverlapConfig, out: Path, progress: Progress) -> Outcome:
    """Measure every way of grouping on the reconstructed mesh."""
    scene = read_scene(inputs)
    mesh = Mesh.load(inputs["surface"] / BASELINE_MESH)
    return measure_groups(scene, scene.views, mesh, inputs, config, out, progress)


def measure_groups(
    scene: GroupingScene, eyes: Views, mesh: Mesh, inputs: Inputs, config: OverlapConfig, out: Path, progress: Progress
) -> Outcome:
    """Write tables and pictures; `eyes` are the views of the scene in the mesh's frame, one for one."""
    if not len(mesh.triangles):
        raise InputError("the mesh has no triangle, so nothing is seen", "see the notes of the stage that made it")
    surface = Raycaster(mesh.xyz, mesh.triangles)
    progress(0, 2, "measuring overlaps")
    own, test = _groups_of(inputs["grouping"])
    comparison = compare(scene, own, test, config, lambda pairs: true_overlaps(eyes, surface, pairs))
    table = summary_table(comparison, scene, _train_views(inputs["grouping"]))
    table.to_parquet(out / OVERLAP_TABLE)
    member_table(comparison, scene).to_parquet(out / OVERLAP_MEMBERS)
    progress(1, 2, "drawing groups")
    pictures = _draw(comparison, scene, inputs["sfm"] / VIEW_IMAGES, out)
    metrics = _metrics(table)
    doubts = _doubts(metrics["bad_members_share"], metrics["unjudged_share"])
    return Outcome(
        metrics=metrics,
        state="degraded" if doubts else "ok",
        notes=(*doubts, *comparison.refused),
        pictures=pictures,
    )


def _doubts(bad: float | None, unjudged: float) -> list[str]:
    doubts = []
    if bad is not None and bad > MANY_APART:
        doubts.append(f"{bad:.0%} of the members of the scene's groups see next to nothing of what the centre sees")
    if unjudged > _MANY_UNJUDGED:
        doubts.append(f"the mesh shows too little to judge {unjudged:.0%} of the members of the scene's groups")
    return doubts


def _groups_of(grouping: Path) -> tuple[Grouped, Grouped]:
    with np.load(grouping / GROUPS) as arrays:
        return Grouped(OWN, arrays["members"]), Grouped(TEST, arrays["test_members"])


def _train_views(grouping: Path) -> int:
    return int((pd.read_parquet(grouping / SPLIT_TABLE)["role"] == str(Role.TRAIN)).sum())


def _metrics(table: pd.DataFrame) -> dict[str, Any]:
    """Return the scene's own figures, and the share of bad members of every way at the paper's K."""
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    at = {(row["method"], row["k"]): row for row in rows}
    own, test = (next(row for row in rows if row["method"] == name) for name in (OWN, TEST))
    metrics = {name: value for name, value in own.items() if name != "method"}
    metrics["test_bad_members_share"] = test["bad_members_share"]
    for method in (*METHODS, BEST):
        for k in SIZES:
            metrics[f"bad_members_{method}_k{k}"] = at.get((method, k), {}).get("bad_members_share")
    return metrics


def _draw(comparison: Comparison, scene: GroupingScene, images: Path, out: Path) -> dict[str, str]:
    k = SIZES[0] if comparison.at(SIZES[0]) else comparison.own(OWN).k
    grouped = {method: made for method, made in comparison.at(k).items() if method != BEST}
    if not grouped:
        return {}
    shown = groups_at_places(scene, grouped, _PLACES_ON_MAP)
    draw_groups(scene, shown, comparison.overlaps, out / GROUPS_MAP)
    shown = {method: members[:_PLACES_IN_COLUMNS] for method, members in shown.items()}
    sheet = draw_columns(lambda view: photo_file(images, scene.views, view), scene.views, shown, comparison.overlaps)
    sheet.save(out / GROUPS_COLUMNS, quality=_QUALITY)
    return {
        f"Groups of {k} at the same places, by every way: cameras": GROUPS_MAP,
        f"Groups of {k} at the same places, by every way: photographs (red: sees under 10 % of the same)": (
            GROUPS_COLUMNS
        ),
    }
