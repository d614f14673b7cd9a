"""The rules of PixelNeRF: how long it trains, how wide it is, how finely it looks along rays."""

from __future__ import annotations

import math

import numpy as np

from aug3d_core.factory.auto.decision import Known
from aug3d_core.factory.auto.parallax import parallax_px
from aug3d_core.factory.config import left_open
from aug3d_core.geometry.views import Points, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS, VIEWS

# Measured at 96 x 72 px. The town's 31 training photographs: 22.2 dB after 300 steps (0.7 looks at each of their pixels),
# 22.8 after 1,200 (2.9); ochota's 42 stopped by themselves at 900 (1.6); brighton's 6 in each of three folds: 18.0 after 200
# (2.5), 18.2 after 1,200 (14.8). 2.4 looks in place of 1.5 gained 0.20, -0.05 and 0.09 dB on three towns and 0.06 on ochota
# (three seeds each), for a fifth more of all the time.
_LOOKS = 1.5
_LEAST_STEPS = 300  # the learning rate has to rise and fall
_PIXELS_PER_WEIGHT = 10
_LEAST_CHANNELS = 8
_WIDTHS = (32, 64, 128, 256)  # the paper's is the last
# The town's layer moves by 20 px: 22.92 dB with 4 + 2 + 1 samples, 22.85 with 8 + 4 + 2, in 0.77 of the time (one seed)
_PX_PER_SAMPLE = 5.0
_LEAST_SAMPLES, _MOST_SAMPLES = 4, 64


def steps(known: Known) -> Decision | None:
    """Look at each pixel of the distinct training photographs so often, in whatever mixture with renders."""
    looked_at = _pixels(known)
    if looked_at is None:
        return None
    (pixels, told), training = looked_at, known.config.training
    rays = training.groups_per_step * _head(known).rays_per_group
    value = max(math.ceil(_LOOKS * pixels / rays), _LEAST_STEPS)
    return Decision(
        field="training.steps",
        value=value,
        measured=f"{told}; a step looks at {rays}",
        rule=f"{_LOOKS:g} rays for each of their pixels, at least {_LEAST_STEPS} steps",
        saves=f"{1 - value / training.steps:.0%} of the preset's {training.steps} steps"
        if value < training.steps
        else "",
        costs="0.2 dB on the town against 1,000 steps, under 0.1 on two other towns and ochota; 300 are about 0.5 dB worse"
        if value < training.steps
        else "",
    )


def warmup_steps(known: Known) -> Decision | None:
    """Let the learning rate rise within the same share of the steps as the preset has it."""
    decided, training = _decided_steps(known), known.config.training
    if decided is None:
        return None
    return Decision(
        field="training.warmup_steps",
        value=min(math.ceil(training.warmup_steps * decided / training.steps), training.warmup_steps),
        measured=f"{decided} steps",
        rule=f"the share of them that the preset's {training.warmup_steps} are of its {training.steps}, never more than those",
    )


def least_gain(known: Known) -> Decision | None:
    """Make all of few steps: what ends a long training early sees too little of a short one."""
    decided, preset = _decided_steps(known), known.config.training.steps
    if decided is None:
        return None
    short = decided <= preset
    return Decision(
        field="training.least_gain_db",
        value=0.0 if short else known.config.training.least_gain_db,
        measured=f"{decided} steps",
        rule=f"0 (all steps are made) up to the preset's {preset} steps; the preset's beyond",
        costs="steps that gain nothing; on the town one of 600 steps ended at 275, about 0.5 dB below those that went on"
        if short
        else "",
    )


def _decided_steps(known: Known) -> int | None:
    """Return the number of steps if it is decided here."""
    decided = steps(known) if "steps" in left_open(known.config, "training") else None
    return int(decided.value or 0) if decided else None


def hidden(known: Known) -> Decision | None:
    """Make the field as wide as there are pixels to learn its weights from."""
    looked_at = _pixels(known)
    if looked_at is None:
        return None
    (pixels, told), head = looked_at, _head(known)
    blocks = head.blocks_per_view + head.blocks_pooled
    fitting = [width for width in _WIDTHS if _weights(width, blocks) * _PIXELS_PER_WEIGHT <= pixels]
    value = max(fitting, default=_WIDTHS[0])
    preset = head.hidden
    return Decision(
        field="training.head.hidden",
        value=value,
        measured=f"{told}; {blocks} blocks {value} wide have {_weights(value, blocks):,} weights",
        rule=f"the widest of {', '.join(map(str, _WIDTHS))} with {_PIXELS_PER_WEIGHT} pixels for each weight, or {_WIDTHS[0]}",
        saves="on the town 32 in place of 64 trained in 0.64 of the time" if value < preset else "",
        costs="0.13 dB on the town, one seed, about as much as two seeds differ" if value < preset else "",
    )


def encoder_channels(known: Known) -> Decision | None:
    """Keep the encoder in proportion with the field."""
    field, head = hidden(known), _head(known)
    if field is None or "head.hidden" not in left_open(known.config, "training"):
        return None
    preset = head.encoder_channels
    value = max(round(preset * int(field.value or 0) / head.hidden), _LEAST_CHANNELS)
    return Decision(
        field="training.head.encoder_channels",
        value=value,
        measured=f"the field is {field.value} wide",
        rule=f"in proportion with it, as {preset} are to the preset's {head.hidden}",
        saves="on the town 12 in place of 24, beside a field 32 wide, trained in 0.81 of the time"
        if value < preset
        else "",
        costs="nothing on the town: 22.88 dB with 12, 22.85 with 24, one seed" if value < preset else "",
    )


def _head(known: Known) -> PixelNerfConfig:
    head = known.config.training.head
    assert isinstance(head, PixelNerfConfig)
    return head


def _weights(width: int, blocks: int) -> int:
    """Count the weights of the coarse and the fine field: two square layers a block."""
    return 2 * blocks * 2 * width**2


def _pixels(known: Known) -> tuple[int, str] | None:
    """Count the pixels of distinct training photographs as they are packed, and tell of them; None before the split."""
    photos, packed = known.training_photos, known.config.dataset
    if photos is None:
        return None
    pixels = photos[1] * packed.width_px * packed.height_px
    return pixels, f"{photos[1]} of {photos[0]} training photographs show something of their own: {pixels:,} pixels"


def coarse_samples(known: Known) -> Decision | None:
    """Sample rays as densely as the parallax between a group's views can tell apart."""
    return _part_of_coarse(known, "coarse_samples", 1)


def fine_samples(known: Known) -> Decision | None:
    """Take half as many where the coarse network saw matter."""
    return _part_of_coarse(known, "fine_samples", 2)


def depth_samples(known: Known) -> Decision | None:
    """Take a quarter as many about the depth that it saw."""
    return _part_of_coarse(known, "depth_samples", 4)


def _part_of_coarse(known: Known, field: str, part: int) -> Decision | None:
    """Return a decision about samples; None where the coarse ones, of which they are a part, are not decided here."""
    parallax = _parallax(known)
    if parallax is None or "head.coarse_samples" not in left_open(known.config, "training"):
        return None
    value = min(max(round(parallax / _PX_PER_SAMPLE), _LEAST_SAMPLES), _MOST_SAMPLES) // part
    preset = getattr(_head(known), field)
    share = {1: "", 2: "half of ", 4: "a quarter of "}[part]
    return Decision(
        field=f"training.head.{field}",
        value=value,
        measured=f"between views of a group the layer from ground to roofs moves by {parallax:.1f} px",
        rule=f"{share}one sample for {_PX_PER_SAMPLE:g} px, of {_LEAST_SAMPLES} to {_MOST_SAMPLES}",
        saves=f"{preset - value} of the preset's {preset} samples on each ray" if value < preset else "",
        costs="nothing on the town, with a sample for 5 px in place of 2.5" if value < preset else "",
    )


def _parallax(known: Known) -> float | None:
    """Return the parallax of a scene whose layer between ground and roofs is known, None of others."""
    thickness, sfm, groups = (
        known.figure("dataset", "slab_thickness"),
        known.folder("sfm"),
        known.folder("grouping"),
    )
    if thickness is None or sfm is None or groups is None:
        return None
    with np.load(groups / GROUPS, allow_pickle=False) as arrays:
        members = arrays["members"]
    views, points = Views.load(sfm / VIEWS), Points.load(sfm / POINTS)
    return parallax_px(views, members, points.xyz, thickness, known.config.dataset.width_px)


RULES = {
    "training.head.encoder_channels": encoder_channels,
    "training.head.hidden": hidden,
    "training.head.coarse_samples": coarse_samples,
    "training.head.fine_samples": fine_samples,
    "training.head.depth_samples": depth_samples,
    "training.steps": steps,
    "training.warmup_steps": warmup_steps,
    "training.least_gain_db": least_gain,
}
