"""Groups that ask for more than photographs share."""

from __future__ import annotations

from aug3d_core.studies.stability.perturbation import Damage, InFactory, Judge, Perturbation
from aug3d_core.studies.stability.world import LONG_TOWN

_DAMAGES = "aug3d_core.studies.stability.damages.tracks"
_WAYS = {way: (f"grouping.method={way}",) for way in ("sequence", "grid", "ray", "shared", "surface")}
# Every second draw of three inputs then holds one that shows next to nothing of the centre (`groups/audit.py`)
BELONG = Judge("bad_members_share", "lower", 0.2, "every fifth member sees next to nothing of the centre", "overlap")

PERTURBATIONS = (
    Perturbation(
        "large groups",
        "Groups",
        "Groups are asked to hold this many photographs.",
        "photographs",
        (4, 8, 12, 16, 24),
        BELONG,
        InFactory(
            "overlap", lambda k: (f"grouping.k={k:g}",), seeded=("town.seed",), world=LONG_TOWN, picture="overlap"
        ),
        _WAYS,
    ),
    Perturbation(
        "lost points",
        "Groups",
        "Only this share of the points of structure from motion is left.",
        "of points",
        (1, 0.3, 0.1, 0.03, 0.01),
        BELONG,
        InFactory(
            "overlap",
            damage=Damage("sfm", f"{_DAMAGES}:lose"),
            seeded=("town.seed",),
            world=LONG_TOWN,
            picture="overlap",
        ),
        _WAYS,
    ),
    Perturbation(
        "isolated photographs",
        "Groups",
        "This share of the photographs keeps one in fifty of the points that it sees.",
        "share",
        (0, 0.2, 0.4, 0.6, 0.8),
        BELONG,
        InFactory(
            "overlap",
            damage=Damage("sfm", f"{_DAMAGES}:isolate"),
            seeded=("town.seed",),
            world=LONG_TOWN,
            picture="overlap",
        ),
        _WAYS,
    ),
)
