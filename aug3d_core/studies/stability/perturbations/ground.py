"""Land that is not level, under models of the ground that take it to be simpler."""

from __future__ import annotations

from aug3d_core.studies.stability.ground_models import CHOSEN, LEVEL, PLANE
from aug3d_core.studies.stability.perturbation import Computed, Judge, Perturbation

_WORLDS = "aug3d_core.studies.stability.ground_models"
# Half a storey: feet of buildings, and where rays meet the ground, are then told wrong
UNDER_FOOT = Judge("ground_error_m", "lower", 1.5, "a tenth of the ground is missed by half a storey")
_METHODS = {LEVEL: (), PLANE: (), CHOSEN: ()}
_SIMPLER = frozenset((LEVEL, PLANE))

PERTURBATIONS = (
    Perturbation(
        "slope",
        "Ground",
        "The land with its houses rises by so much to the north.",
        "degrees",
        (0, 3, 6, 12, 20, 30),
        UNDER_FOOT,
        Computed(f"{_WORLDS}:slope"),
        _METHODS,
        _SIMPLER,
        quick=True,
    ),
    Perturbation(
        "terraces",
        "Ground",
        "The land rises in steps 30 m apart, by so much in the mean.",
        "degrees",
        (0, 3, 6, 12, 20, 30),
        UNDER_FOOT,
        Computed(f"{_WORLDS}:terraces"),
        _METHODS,
        _SIMPLER,
    ),
)
