"""Photographs that are hard to put together: too little overlap, sameness, blur, light, a lens that EXIF has wrong."""

from __future__ import annotations

from aug3d_core.studies.stability.perturbation import Damage, InFactory, Judge, Perturbation
from aug3d_core.studies.stability.perturbations.surface import RIGHT
from aug3d_core.studies.stability.world import LONG_TOWN

_DAMAGES = "aug3d_core.studies.stability.damages.photographs"
# So few pairs that it matters which: 6 neighbours, as a large scene has 20 of thousands
FEW_PAIRS = ("matching.neighbours=6", "matching.exhaustive_limit=10")
_PAIR_CHOICES = {f"pairs {way}": (f"matching.pairs={way}", *FEW_PAIRS) for way in ("exhaustive", "gps", "coarse")}
_MAPPERS = {f"{way} mapper": (f"sfm.mapper={way}",) for way in ("incremental", "global", "hierarchical")}
_SEEDED = ("town.seed",)

# A photograph that is lost loses all its pairs: a quarter of them lost leaves 0.56, which is when `sfm` says that they
# are few. Poses that are right to half a degree score 0.9 and more.
PLACED = Judge(
    "pose_auc_five_deg",
    "higher",
    0.5,
    "of all pairs of photographs, less than half are placed right to some degrees: a quarter of the photographs is lost, or"
    " the poses are bent",
    "truth",
)
# The factory's own bound for a flight that is bent (`sfm/doming.py`)
UNBENT = Judge(
    "position_error_pct", "lower", 1.0, "half the cameras are more than 1 % of the flight's extent off", "truth"
)
# 5 % of each side of the frame
SHOWN = Judge(
    "footprint_iou", "higher", 0.9, "half the photographs are laid over the wrong tenth of the ground", "truth"
)


def _lens(k1: float) -> tuple[str, ...]:
    """Flown straight down; the second term of a lens, as of real ones, is what a bent flight can take the place of."""
    return "town.path=nadir", f"town.radial_k1={-k1}", f"town.radial_k2={k1 / 4}"


def _overlap(percent: float) -> tuple[str, ...]:
    return f"town.forward_overlap={percent / 100}", f"town.side_overlap={max(20, percent - 10) / 100}"


def _textureless(kind: float) -> tuple[str, ...]:
    return f"town.bare_roofs={kind in (1, 3)}", f"town.lake={kind in (2, 3)}"


PERTURBATIONS = (
    Perturbation(
        "overlap",
        "Photographs",
        "The flight's photographs overlap less and less along its lines, and 10 % less across.",
        "% overlap",
        (80, 70, 60, 50, 40, 30),
        PLACED,
        InFactory("truth", _overlap, seeded=_SEEDED),
        _PAIR_CHOICES | _MAPPERS,
    ),
    Perturbation(
        "identical houses",
        "Photographs",
        "Every house is the same to the pixel, and more and more of its walls is seen.",
        "degrees ahead",
        (0, 15, 30, 45),
        PLACED,
        InFactory("truth", lambda tilt: ("town.buildings=identical", f"town.tilt_deg={tilt}"), seeded=_SEEDED),
        _PAIR_CHOICES,
    ),
    Perturbation(
        "straight down",
        "Photographs",
        "All photographs look straight down through a lens that bends more and more: a bent flight explains them as well.",
        "-k1",
        (0, 0.05, 0.1, 0.2),
        UNBENT,
        InFactory("truth", _lens, seeded=_SEEDED),
        {"with GPS": (), "without GPS": ("town.gps=false",)},
    ),
    Perturbation(
        "wrong focal length",
        "Photographs",
        "EXIF states a focal length that is this many times the true one.",
        "times",
        (1, 1.05, 1.2, 1.5, 2.5),
        SHOWN,
        InFactory("truth", damage=Damage("photos", f"{_DAMAGES}:wrong_focal"), seeded=_SEEDED),
        _MAPPERS,
    ),
    Perturbation(
        "blur",
        "Photographs",
        "Every photograph is blurred.",
        "px",
        (0, 1, 2, 4, 8),
        PLACED,
        InFactory("truth", damage=Damage("town", f"{_DAMAGES}:blur"), seeded=_SEEDED, picture="photos"),
        _PAIR_CHOICES,
        quick=True,
    ),
    Perturbation(
        "exposure step",
        "Photographs",
        "From the middle of the flight on, photographs are this many times as bright.",
        "times",
        (1, 2, 4, 8, 16),
        PLACED,
        InFactory("truth", damage=Damage("town", f"{_DAMAGES}:brighten"), seeded=_SEEDED, picture="photos"),
        _PAIR_CHOICES,
    ),
    Perturbation(
        "islands",
        "Photographs",
        "The middle of a long town was never photographed, for so many metres; a photograph shows 43 m of it.",
        "m",
        (0, 30, 60, 90),
        PLACED,
        InFactory("truth", damage=Damage("town", f"{_DAMAGES}:tear_apart"), seeded=_SEEDED, world=LONG_TOWN),
        _MAPPERS,
    ),
    Perturbation(
        "fading texture",
        "Photographs",
        "All detail fades to this share of its contrast, while the sensor's noise stays: haze, snow, a bare field.",
        "of contrast",
        (1, 0.3, 0.1, 0.03, 0.01),
        PLACED,
        InFactory("truth", damage=Damage("town", f"{_DAMAGES}:fade"), seeded=_SEEDED, picture="photos"),
        _PAIR_CHOICES,
    ),
    Perturbation(
        "lake and bare roofs",
        "Photographs",
        "Of 0 nothing, of 1 roofs have one colour, of 2 there is a lake whose ripples last for one photograph, of 3 both.",
        "of these",
        (0, 1, 2, 3),
        RIGHT,
        InFactory("mesh_truth", _textureless, seeded=_SEEDED, picture="surface"),
        {"fine depth planes": (), "coarse depth planes": ("depth.plane_step_px=4",)},
    ),
)
