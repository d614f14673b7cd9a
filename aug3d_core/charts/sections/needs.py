"""What the scene needed and why: every size that was chosen, the value, what was measured, and the rule."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from aug3d_core.charts.html import number, table, tag
from aug3d_core.charts.sections.run import Run

_CALLED = {
    "matching.pairs": "pairs compared",
    "sfm.mapper": "mapper",
    "sfm.camera_model": "camera model",
    "sfm.focal": "focal length",
    "sfm.up": "vertical",
    "sfm.ground": "ground model",
    "grouping.distinct_photos": "photographs worth training on",
    "grouping.k": "photographs in a group (K)",
    "grouping.gap_footprints": "gap around the test, footprints",
    "grouping.folds": "folds",
    "depth.engine": "depth engine",
    "depth.planes": "depth planes, median",
    "surface.octree_depth": "mesh: octree depth",
    "surface.triangles": "mesh: triangles",
    "surface.texels": "mesh: texels",
    "sampling.views": "virtual views",
    "sampling.scales": "virtual views: ground seen",
    "rendering.samples": "samples per pixel",
    "training.steps_made": "training steps made",
    "training.encoder_from": "encoder from",
}
_HEADS = ("what", "chosen", "measured: rule")
_IN_TURN = {"saves": "saves", "costs": "may cost:"}
_SAID = (
    "Sizes and methods of this scene: decided from it by the preset auto (bold), chosen by a stage, or set, with the reason."
    " What it may cost was measured on the built-in town."
)


def needs(run: Run) -> str:
    """Return a row per decision of one fold; what comes before the split is told with the first."""
    rows = [_row(found) for found in run.metrics.get("needs", ()) if found["fold"] == run.fold]
    return tag("p", _SAID, class_="dim") + tag("div", table(_HEADS, rows), class_="wrapped") if rows else ""


def _row(found: Mapping[str, Any]) -> tuple[str, ...]:
    field = str(found["field"])
    called = escape(_CALLED.get(field, field))
    why = escape(": ".join(said for said in (found["measured"], found["rule"]) if said))
    in_turn = "; ".join(f"{what} {found[name]}" for name, what in _IN_TURN.items() if found[name])
    return (
        tag("b", called) if found["by"] == "auto" else called,
        tag("b", number(found["value"])),
        why + tag("div", escape(in_turn), class_="dim") if in_turn else why,
    )
