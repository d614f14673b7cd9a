"""The colours of cameras: by their group, by their part in the split, or by how well they were placed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int, UInt8

GROUP, SPLIT, REGISTRATION = "group", "split", "registration"
TARGET = "target"  # the role of a test view, which has its colour however the others are coloured
ROLES = {
    "train": (66, 133, 244),
    "spare": (210, 210, 210),
    "gap": (150, 150, 150),
    "support": (52, 168, 83),
    TARGET: (234, 67, 53),
}
_NONE = (150, 150, 150)
DOME = (171, 71, 188)
_GOOD, _POOR = np.array([52, 168, 83.0]), np.array([251, 188, 4.0])
_POOR_TIMES = 2.0  # the middle error: a camera this far off is as yellow as it gets
_GOLDEN = 0.61803398875  # of a turn: neighbouring groups differ


def colours_of(
    by: str, roles: Sequence[str], group: Int[np.ndarray, " n"], error_px: Float[np.ndarray, " n"]
) -> UInt8[np.ndarray, "n 3"]:
    """Return each camera's colour. group: -1 for none. error_px: mean reprojection error, NaN if it sees no point."""
    if by == GROUP:
        rgb = np.array([_NONE if one < 0 else _hue(int(one)) for one in group], float).reshape(-1, 3)
    elif by == SPLIT:
        rgb = np.array([ROLES.get(role, _NONE) for role in roles], float).reshape(-1, 3)
    else:
        known = np.isfinite(error_px)
        usual = float(np.median(error_px[known])) if known.any() else 1.0
        share = np.clip((np.where(known, error_px, np.inf) / max(usual, 1e-9) - 1) / (_POOR_TIMES - 1), 0, 1)
        rgb = _GOOD + share[:, None] * (_POOR - _GOOD)
    test = np.array([role == TARGET for role in roles], bool)
    rgb[test] = ROLES[TARGET]
    return np.rint(rgb).astype(np.uint8)


def _hue(number: int) -> tuple[float, float, float]:
    """Return a strong colour, another for each number, and never the red of test views."""
    turn = 0.08 + 0.84 * (number * _GOLDEN % 1.0)
    r, g, b = (255 * (0.55 + 0.4 * np.cos(2 * np.pi * (turn - shift))) for shift in (0, 1 / 3, 2 / 3))
    return float(r), float(g), float(b)
