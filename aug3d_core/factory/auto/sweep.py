"""The rules of the plane sweep: how long it trains, how many planes it compares, from how many photographs it predicts."""

from __future__ import annotations

from aug3d_core.factory.auto.decision import Known
from aug3d_core.factory.auto.length import Length
from aug3d_core.factory.auto.parallax import known_parallax
from aug3d_core.factory.auto.views import support_photos
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.run.stage import Decision

_PX_PER_PLANE = 1.5  # of a packed view: a third of a feature of the coarse volume
_LEAST_PLANES, _MOST_PLANES, _IN_STEPS_OF = 16, 128, 8
_MOST_GIVEN = 6


def planes(known: Known) -> Decision | None:
    """Put the planes as close as the coarse features can tell apart."""
    parallax = known_parallax(known)
    if parallax is None:
        return None
    preset = _head(known).planes
    wanted = _IN_STEPS_OF * round(parallax / _PX_PER_PLANE / _IN_STEPS_OF)
    value = min(max(wanted, _LEAST_PLANES), _MOST_PLANES)
    return Decision(
        field="training.head.planes",
        value=value,
        measured=f"between views of a group the layer from ground to roofs moves by {parallax:.1f} px",
        rule=f"one plane for {_PX_PER_PLANE:g} px, in steps of {_IN_STEPS_OF}, of {_LEAST_PLANES} to {_MOST_PLANES}",
        saves=f"{1 - value / preset:.0%} of the coarse volume" if value < preset else "",
        costs="0.3 dB on the town from the inputs alone, nothing on ochota or about a scaffold, with 16 in place of 32, one"
        " seed"
        if value < preset
        else "",
    )


def input_views(known: Known) -> Decision | None:
    """Predict from more photographs than the test needs: what one does not show, another does."""
    there = support_photos(known)
    if there is None:
        return None
    return Decision(
        field="evaluation.input_views",
        value=min(_MOST_GIVEN, there),
        measured=f"{there} photographs for each that is held out",
        rule=f"{_MOST_GIVEN}, as far as there are so many",
        costs="twice the time of a view from three; from 3, 4 and 6 photographs alone the town's have 22.0, 22.7 and 22.4 dB,"
        " ochota's 23.0, 23.1 and 23.4",
    )


def _head(known: Known) -> SweepConfig:
    head = known.config.training.head
    assert isinstance(head, SweepConfig)
    return head


def _crop(known: Known) -> int:
    return _head(known).crop_px ** 2 * 3 // 4


# From the shipped weights, 0 | 100 | 300 steps of the preset (ochota: 312), which look 0, 0.8 to 4 and 2.4 to 12 times at each
# pixel of the training photographs; about the scaffold, alone [dB], one seed (2026-11-30). Town of seed 7: 28.30, 24.67 |
# 28.21, 24.20 | 28.28, 24.51. Seed 9: 27.51, 24.61 | 27.38, 24.17 | 27.31, 23.80. ochota: 27.70, 26.02 | 27.77, 26.39 |
# 27.78, 26.16. brighton, both folds: 18.59, 17.32 | 18.73, 17.70 | 18.83, 17.76.
_LENGTH = Length(
    looks=1,
    least_steps=100,
    pixels_per_group=_crop,
    costs="against three looks 0.1 dB on leaves, and from the inputs alone 0.3 dB on one of two towns",
)

RULES = {
    "training.head.planes": planes,
    "evaluation.input_views": input_views,
    **_LENGTH.rules,
}
