"""The rules of PixelNeRF: how long it trains, how wide it is, how finely it looks along rays."""

from __future__ import annotations

from aug3d_core.factory.auto.decision import Known
from aug3d_core.factory.auto.length import Length, photographed_pixels
from aug3d_core.factory.auto.parallax import known_parallax
from aug3d_core.factory.config import left_open
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.run.stage import Decision

_PIXELS_PER_WEIGHT = 10
_LEAST_CHANNELS = 8
_WIDTHS = (32, 64, 128, 256)  # the paper's is the last
# The town's layer moves by 20 px: 22.92 dB with 4 + 2 + 1 samples, 22.85 with 8 + 4 + 2, in 0.77 of the time (one seed)
_PX_PER_SAMPLE = 5.0
_LEAST_SAMPLES, _MOST_SAMPLES = 4, 64


def hidden(known: Known) -> Decision | None:
    """Make the field as wide as there are pixels to learn its weights from."""
    looked_at = photographed_pixels(known)
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
    parallax = known_parallax(known)
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


# Measured at 96 x 72 px. The town's 31 training photographs: 22.2 dB after 300 steps (0.7 looks at each of their pixels),
# 22.8 after 1,200 (2.9); ochota's 42 stopped by themselves at 900 (1.6); brighton's 6 in each of three folds: 18.0 after 200
# (2.5), 18.2 after 1,200 (14.8). 2.4 looks in place of 1.5 gained 0.20, -0.05 and 0.09 dB on three towns and 0.06 on ochota
# (three seeds each), for a fifth more of all the time.
_LENGTH = Length(
    looks=1.5,
    least_steps=300,
    pixels_per_group=lambda known: _head(known).rays_per_group,
    costs="0.2 dB on the town against 1,000 steps, under 0.1 on two other towns and ochota; 300 are about 0.5 dB worse",
)

RULES = {
    "training.head.encoder_channels": encoder_channels,
    "training.head.hidden": hidden,
    "training.head.coarse_samples": coarse_samples,
    "training.head.fine_samples": fine_samples,
    "training.head.depth_samples": depth_samples,
    **_LENGTH.rules,
}
