"""Which settings the preset `auto` leaves open; `rules.py` holds a rule for each."""

from __future__ import annotations

LEFT_OPEN = (
    "photos.max_px",
    "photos.least_motion",
    "matching.first_octave",
    "depth.max_px",
    "depth.plane_step_px",
    "surface.texel_gsd",
    "sampling.width_px",
    "sampling.height_px",
    "sampling.domes",
    "training.rendered_share",
    "training.encoder_channels",
    "training.hidden",
    "training.coarse_samples",
    "training.fine_samples",
    "training.depth_samples",
    "training.steps",
    "training.warmup_steps",
    "training.least_gain_db",
    "evaluation.input_views",
)
