"""The surface: fused points that float, are missing or turned the wrong way, and triangles that are dropped."""

from __future__ import annotations

from aug3d_core.studies.stability.perturbation import Damage, InFactory, Judge, Perturbation

_DAMAGES = "aug3d_core.studies.stability.damages.fused"
_PART = "Surface"
_SEEDED = ("town.seed",)

# The harmonic mean of how much of the mesh is right and how much of the truth is there
RIGHT = Judge(
    "fscore_half_pct",
    "higher",
    0.5,
    "half of the mesh is off by more than 0.5 % of the scene's extent, or half of the surface is missing",
    "mesh_truth",
)


def _damaged(damage: str) -> InFactory:
    return InFactory("mesh_truth", damage=Damage("depth", f"{_DAMAGES}:{damage}"), seeded=_SEEDED, picture="surface")


PERTURBATIONS = (
    Perturbation(
        "floaters",
        _PART,
        "Clumps of points float over the town, as many as this share of the true points.",
        "share",
        (0, 0.05, 0.2, 0.8),
        RIGHT,
        _damaged("floaters"),
        {"small pieces dropped": (), "all pieces kept": ("surface.min_piece_points=0",)},
    ),
    Perturbation(
        "holes",
        _PART,
        "Points are missing in round places that make up this share of all.",
        "share",
        (0, 0.2, 0.4, 0.6, 0.8),
        RIGHT,
        _damaged("holes"),
        {"small holes closed": (), "all holes left": ("surface.max_gap_spacings=0",)},
        quick=True,  # not the floaters: a mesh full of them takes a minute
    ),
    Perturbation(
        "flipped normals",
        _PART,
        "In round places that make up this share of all points, normals point the wrong way.",
        "share",
        (0, 0.1, 0.3, 0.6, 1),
        RIGHT,
        _damaged("flipped"),
    ),
    Perturbation(
        "decimation",
        _PART,
        "Triangles are dropped until the surface has moved this far.",
        "pixels on the ground",
        (0.5, 2, 6, 20),
        RIGHT,
        InFactory("mesh_truth", lambda gsd: (f"surface.max_error_gsd={gsd}",), seeded=_SEEDED, picture="surface"),
        {"colour in a texture": (), "colour at vertices": ("surface.colour=vertex",)},
    ),
)
