"""The finder of buildings, on villages that are known exactly."""

from __future__ import annotations

from aug3d_core.studies.stability.box_finder import BOX_F1, DIVIDED, OVER_GRID, PERCENTILE
from aug3d_core.studies.stability.perturbation import Computed, Judge, Perturbation

_COMPUTE = "aug3d_core.studies.stability.box_finder"
_PART = "Finder of buildings"
_CUTS = {DIVIDED: (), PERCENTILE: ()}  # the computed cell knows them by name

FOUND = Judge(BOX_F1, "higher", 0.5, "half of the boxes hold no building, or half of the buildings have no box")
# Set after trees were tried: of boxes among 80 bare ones half hold no building, which nothing in a picture from above tells
USEFUL = Judge(
    OVER_GRID, "higher", 1.0, "a box holds a building no more often than the square of a grid would, laid out blindly"
)

PERTURBATIONS = (
    Perturbation(
        "village on a slope",
        _PART,
        "The ground under the village rises evenly.",
        "degrees",
        (0, 10, 20, 30),
        FOUND,
        Computed(f"{_COMPUTE}:on_slope"),
        _CUTS,
    ),
    Perturbation(
        "village on terraces",
        _PART,
        "Half of the village stands higher than the other, by up to twice the height of its houses.",
        "m",
        (0, 4, 8, 16),
        FOUND,
        Computed(f"{_COMPUTE}:on_terraces"),
        _CUTS,
        quick=True,
    ),
    Perturbation(
        "trees in leaf",
        _PART,
        "Trees as wide and as high as small houses stand among twelve houses.",
        "trees",
        (0, 12, 40, 80),
        USEFUL,
        Computed(f"{_COMPUTE}:among_trees"),
        _CUTS,
    ),
    Perturbation(
        "bare trees",
        _PART,
        "The same trees without leaves: what tells them from houses is gone.",
        "trees",
        (0, 12, 40, 80),
        USEFUL,
        Computed(f"{_COMPUTE}:among_bare_trees"),
        _CUTS,
    ),
    Perturbation(
        "houses taken away",
        _PART,
        "Of twelve houses among twelve trees, this many are gone; in the end there is none to find.",
        "houses",
        (0, 6, 11, 12),
        FOUND,
        Computed(f"{_COMPUTE}:few_houses"),
        _CUTS,
    ),
)
