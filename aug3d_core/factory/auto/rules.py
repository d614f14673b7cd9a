"""The rule for each setting that may be left open.

A rule returns None where the scene tells it nothing: then the setting stays as the preset has it.
"""

from __future__ import annotations

from collections.abc import Callable

from aug3d_core.factory.auto import network, pictures, views
from aug3d_core.factory.auto.decision import Known
from aug3d_core.run.stage import Decision

RULES: dict[str, Callable[[Known], Decision | None]] = {
    "photos.max_px": pictures.photo_px,
    "photos.least_motion": pictures.least_motion,
    "matching.first_octave": pictures.first_octave,
    "depth.max_px": pictures.depth_px,
    "depth.plane_step_px": pictures.plane_step,
    "surface.texel_gsd": pictures.texel,
    "sampling.width_px": pictures.view_width,
    "sampling.height_px": pictures.view_height,
    "sampling.domes": views.domes,
    "training.rendered_share": views.rendered_share,
    "training.encoder_channels": network.encoder_channels,
    "training.hidden": network.hidden,
    "training.coarse_samples": network.coarse_samples,
    "training.fine_samples": network.fine_samples,
    "training.depth_samples": network.depth_samples,
    "training.steps": network.steps,
    "training.warmup_steps": network.warmup_steps,
    "training.least_gain_db": network.least_gain,
    "evaluation.input_views": views.input_views,
}
