"""Decisions: every chosen setting with its value, the measurement and the rule."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from aug3d_core.report.html import number, table, tag
from aug3d_core.report.reported_run import ReportedRun

_CALLED = {
    "matching.pairs": "pairs compared",
    "sfm.mapper": "mapper",
    "sfm.poses": "poses of earlier photographs",
    "sfm.camera_model": "camera model",
    "sfm.focal": "focal length",
    "sfm.falloff": "darker corners",
    "sfm.up": "vertical",
    "sfm.ground": "ground model",
    "grouping.enough": "photographs worth using",
    "grouping.k": "photographs in a group (K)",
    "grouping.gap_footprints": "gap around the test [footprints]",
    "grouping.test": "test photographs of before",
    "grouping.folds": "folds",
    "depth.planes": "depth planes, median",
    "depth.maps": "depth maps of before",
    "surface.octree_depth": "mesh: octree depth",
    "surface.triangles": "mesh: triangles",
    "surface.texels": "mesh: texels",
    "sampling.views": "virtual views",
    "sampling.scales": "virtual views: ground covered",
    "rendering.samples": "samples per pixel",
    "training.steps_made": "training steps done",
    "training.encoder_from": "encoder from",
}
_HEADS = ("setting", "value", "measurement: rule")
_EFFECTS = {"saves": "saves", "costs": "may cost:"}
_SAID = (
    "Settings of this scene and the reasons for them: decided by the preset auto (bold), by a stage, or by you."
    " Possible costs were measured on the built-in town."
)


def needs(run: ReportedRun) -> str:
    """Return a row per decision of one fold. The first fold includes what comes before the split."""
    rows = [_row(found) for found in run.metrics.get("needs", ()) if found["fold"] == run.fold]
    return tag("p", _SAID, class_="dim") + tag("div", table(_HEADS, rows), class_="wrapped") if rows else ""


def _row(found: Mapping[str, Any]) -> tuple[str, ...]:
    field = str(found["field"])
    called = escape(_CALLED.get(field, field))
    why = escape(": ".join(said for said in (found["measured"], found["rule"]) if said))
    effects = "; ".join(f"{what} {found[name]}" for name, what in _EFFECTS.items() if found[name])
    return (
        tag("b", called) if found["by"] == "auto" else called,
        tag("b", number(found["value"])),
        why + tag("div", escape(effects), class_="dim") if effects else why,
    )
