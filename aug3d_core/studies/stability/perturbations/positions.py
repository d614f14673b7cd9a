"""GPS that is noisy or wrong: what it does to the world that a reconstruction is put into, and to the choice of pairs."""

from __future__ import annotations

from aug3d_core.studies.stability.perturbation import Computed, Damage, InFactory, Judge, Perturbation
from aug3d_core.studies.stability.perturbations.photographs import FEW_PAIRS, PLACED

_DAMAGES = "aug3d_core.studies.stability.damages.positions"
_WORLDS = "aug3d_core.studies.stability.alignment"
_CHOICES = {f"pairs {way}": (f"matching.pairs={way}", *FEW_PAIRS) for way in ("gps", "auto", "coarse")}
# Heights of buildings, footprints and distances are then right to a twentieth
TRUE_TO_SCALE = Judge(
    "world_error_pct",
    "lower",
    5.0,
    "cameras are off by a twentieth of the flight's extent, through a wrong scale, heading or vertical",
)

PERTURBATIONS = (
    Perturbation(
        "gps noise: the world",
        "Positions",
        "GPS positions scatter about the true ones by this much along each axis; the flight is 85 m long.",
        "m",
        (0, 1.5, 5, 10, 20, 50),
        TRUE_TO_SCALE,
        Computed(f"{_WORLDS}:noisy"),
        quick=True,
    ),
    Perturbation(
        "gps outliers: the world",
        "Positions",
        "This share of the GPS positions is 100 m off, each in a direction of its own.",
        "share",
        (0, 0.1, 0.25, 0.4, 0.5, 0.7),
        TRUE_TO_SCALE,
        Computed(f"{_WORLDS}:wild"),
    ),
    Perturbation(
        "gps noise: the pairs",
        "Positions",
        "GPS positions scatter about the true ones by this much along each axis, and 6 neighbours are compared.",
        "m",
        (0, 5, 15, 50, 200),
        PLACED,
        InFactory("truth", damage=Damage("photos", f"{_DAMAGES}:scatter"), seeded=("town.seed",)),
        _CHOICES,
    ),
    Perturbation(
        "gps outliers: the pairs",
        "Positions",
        "This share of the GPS positions is 100 m off, each in a direction of its own, and 6 neighbours are compared.",
        "share",
        (0, 0.1, 0.3, 0.6, 1.0),
        PLACED,
        InFactory("truth", damage=Damage("photos", f"{_DAMAGES}:throw"), seeded=("town.seed",)),
        _CHOICES,
    ),
)
