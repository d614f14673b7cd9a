"""Virtual views: noise of the renderer, domes that sink into the ground, photographs of the test that leak."""

from __future__ import annotations

from aug3d_core.studies.stability.learning_world import LEARNING_TOWN
from aug3d_core.studies.stability.perturbation import Damage, InFactory, Judge, Perturbation
from aug3d_core.studies.stability.perturbations.learning import ABOVE_ONE_COLOUR

_DAMAGES = "aug3d_core.studies.stability.damages.placed"
_PART = "Virtual views and the data set"
_SEEDED = ("training.seed",)

CLEAN = Judge(
    "leak_training_photos", "lower", 0, "a photograph of the test in training makes the test worthless", "dataset"
)
APART = Judge(
    "leak_mesh_photos",
    "lower",
    0,
    "a photograph of the test in the mesh reaches training through every render",
    "dataset",
)

PERTURBATIONS = (
    Perturbation(
        "render noise",
        _PART,
        "Views are rendered with fewer and fewer samples.",
        "samples",
        (64, 16, 4, 1),
        ABOVE_ONE_COLOUR,
        InFactory(
            "evaluation",
            lambda samples: (f"rendering.samples={samples:.0f}",),
            seeded=_SEEDED,
            world=LEARNING_TOWN,
            picture="rendering",
        ),
        {"by own light": (), "in sunlight": ("rendering.light=sunlit",)},
    ),
    Perturbation(
        "sunk domes",
        _PART,
        "Domes sink: at 1 their lowest camera is as low as what it looked at, beyond they are under the surface.",
        "of their height",
        (0, 0.5, 0.9, 1.2, 2),
        ABOVE_ONE_COLOUR,
        InFactory(
            "evaluation",
            damage=Damage("sampling", f"{_DAMAGES}:sunk"),
            seeded=_SEEDED,
            world=LEARNING_TOWN,
            picture="rendering",
        ),
        quick=True,
    ),
    Perturbation(
        "leak into groups",
        _PART,
        "Photographs of the test are put into training groups.",
        "photos",
        (0, 1, 2, 4),
        CLEAN,
        InFactory(
            "dataset",
            damage=Damage("grouping", f"{_DAMAGES}:leaked_into_groups"),
            world=LEARNING_TOWN,
            picture="dataset",
        ),
    ),
    Perturbation(
        "leak into the mesh",
        _PART,
        "Photographs of the test shape and colour the mesh that is rendered.",
        "photos",
        (0, 1, 2, 4),
        APART,
        InFactory(
            "dataset",
            damage=Damage("surface", f"{_DAMAGES}:leaked_into_mesh"),
            world=LEARNING_TOWN,
            picture="dataset",
        ),
    ),
)
