"""The rule for each setting that may be left open.

A rule returns None where the scene tells it nothing: then the setting stays as the preset has it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from aug3d_core.factory.auto import pictures, pixelnerf, sweep, views
from aug3d_core.factory.auto.decision import Known
from aug3d_core.run.stage import Decision

Rule = Callable[[Known], Decision | None]

RULES: Mapping[str, Rule] = {
    "photos.max_px": pictures.photo_px,
    "photos.least_motion": pictures.least_motion,
    "matching.first_octave": pictures.first_octave,
    "depth.max_px": pictures.depth_px,
    "surface.texel_gsd": pictures.texel,
    "sampling.width_px": pictures.view_width,
    "sampling.height_px": pictures.view_height,
    "sampling.domes": views.domes,
    "training.rendered_share": views.rendered_share,
    "evaluation.input_views": views.input_views,
}
# How a model is trained, and its own settings: measured for each head by itself
RULES_OF_HEADS: Mapping[str, Mapping[str, Rule]] = {"pixelnerf": pixelnerf.RULES, "sweep": sweep.RULES}


def rule_of(field: str, head: str) -> Rule | None:
    """Return the rule that decides a field where a head is trained, None if there is none."""
    return RULES_OF_HEADS.get(head, {}).get(field) or RULES.get(field)
