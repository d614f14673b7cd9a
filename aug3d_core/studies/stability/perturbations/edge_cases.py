"""The paper's three edge cases of grouping, each growing until it is as bad as the paper draws it, and beyond."""

from __future__ import annotations

from aug3d_core.groups.methods import METHODS
from aug3d_core.studies.stability.edge_cases import BAD_MEMBERS
from aug3d_core.studies.stability.perturbation import Computed, Judge, Perturbation

_COMPUTE = "aug3d_core.studies.stability.edge_cases"
_PART = "The paper's edge cases of grouping"
_WAYS = {way: () for way in METHODS}

TOGETHER = Judge(
    BAD_MEMBERS,
    "lower",
    0.2,
    "every second draw of three input views then holds one that shows next to nothing of the group's centre:"
    " 1 - 0.8^3 = 0.49 (the grouping stage's own bound)",
)

PERTURBATIONS = (
    Perturbation(
        "abrupt turns",
        _PART,
        "Lines flown to and fro, looking well ahead, get shorter: more turns lie within ten photographs in a row.",
        "turns in ten photos",
        (0.3, 0.4, 0.7, 1.25, 1.7, 2.5),
        TOGETHER,
        Computed(f"{_COMPUTE}:turns"),
        _WAYS,
        quick=True,
    ),
    Perturbation(
        "near cameras that look apart",
        _PART,
        "Rings of cameras about squares side by side look inwards more and more: the rings cross, and neighbours look at"
        " different squares.",
        "degrees inwards",
        (5, 15, 25, 35, 45),
        TOGETHER,
        Computed(f"{_COMPUTE}:apart"),
        _WAYS,
    ),
    Perturbation(
        "high buildings",
        _PART,
        "Slabs photographed from both sides grow: central rays of both sides meet the ground at their foot, and each side"
        " sees its own walls.",
        "m",
        (10, 20, 30, 40, 70),
        TOGETHER,
        Computed(f"{_COMPUTE}:height"),
        _WAYS,
    ),
)
