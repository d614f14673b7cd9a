"""Training and test: learning rates, near and far, the unit of the world, what the model is given."""

from __future__ import annotations

from collections.abc import Callable

from aug3d_core.studies.stability.learning_world import LEARNING_TOWN, MANY_PHOTOS, PIXELNERF
from aug3d_core.studies.stability.perturbation import Damage, InFactory, Judge, Overrides, Perturbation, no_settings

_PLACED = "aug3d_core.studies.stability.damages.placed"
_PACKED = "aug3d_core.studies.stability.damages.packed"
_PART = "Training and test"
_SEEDED = ("training.seed",)
_SWEEP, _ALONE, _NERF = "plane sweep", "plane sweep without scaffold", "PixelNeRF"
NO_SCAFFOLD = ("training.head.scaffold=false",)
_BOTH = {_SWEEP: (), _NERF: PIXELNERF}
_RATE = 2e-3  # of dose 1

ABOVE_ONE_COLOUR = Judge(
    "test_psnr_mean",
    "higher",
    0.0,
    "dB above the mean colour of the input views: below, the model is worse than no model",
    "evaluation",
    over="cheap_mean_colour",
)


def _learns(
    settings: Callable[[float], Overrides] = no_settings,
    damage: Damage | None = None,
    world: Overrides = LEARNING_TOWN,
) -> InFactory:
    return InFactory("evaluation", settings, damage, _SEEDED, world, picture="evaluation")


def _rate(times: float) -> Overrides:
    return (f"training.learning_rate={_RATE * times:.6g}",)


def _inputs(views: float) -> Overrides:
    return f"training.input_views={views:.0f}", f"evaluation.input_views={views:.0f}"


PERTURBATIONS = (
    Perturbation(
        "learning rate too high",
        _PART,
        f"The network learns at so many times a rate of {_RATE:g}.",
        "times",
        (1, 3, 10, 33),
        ABOVE_ONE_COLOUR,
        _learns(_rate),
        {
            **_BOTH,
            "PixelNeRF that makes colours up": (*PIXELNERF, "training.head.blend_inputs=false"),
            "PixelNeRF with density by relu": (*PIXELNERF, "training.head.density=relu"),
        },
    ),
    Perturbation(
        "learning rate too low",
        _PART,
        f"The network learns at this share of a rate of {_RATE:g}.",
        "times",
        (1, 0.1, 0.01, 0.001),
        ABOVE_ONE_COLOUR,
        _learns(_rate),
        _BOTH,
    ),
    Perturbation(
        "near and far too close",
        _PART,
        "Near and far of every view are multiplied by this.",
        "times",
        (1, 0.8, 0.5, 0.2),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:bounds_times")),
        {**_BOTH, "PixelNeRF between near and far": (*PIXELNERF, "training.head.slab_bounds=false")},
    ),
    Perturbation(
        "near and far too far",
        _PART,
        "Near and far of every view are multiplied by this.",
        "times",
        (1, 1.25, 2, 5),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:bounds_times")),
        {**_BOTH, "PixelNeRF between near and far": (*PIXELNERF, "training.head.slab_bounds=false")},
    ),
    Perturbation(
        "unit of the world",
        _PART,
        "Poses and points are in a unit of which this many make a metre.",
        "units per m",
        (1, 0.1, 0.01, 10, 100),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("sfm", f"{_PLACED}:scaled")),
    ),
    Perturbation(
        "unrelated input views",
        _PART,
        "This share of the views that the test predicts from show some other place.",
        "share",
        (0, 0.25, 0.5, 1),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:unrelated")),
        {
            **_BOTH,
            "PixelNeRF as in the paper": (
                *PIXELNERF,
                "training.head.see_pixels=false",
                "training.head.blend_inputs=false",
            ),
        },
    ),
    Perturbation(
        "training in the dark",
        _PART,
        "All that training sees is so many times darker than the test: a camera that exposes by itself, over another street.",
        "times",
        (1, 2, 4, 8),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:darker_training")),
        {**_BOTH, "PixelNeRF with colours as they are": (*PIXELNERF, "training.head.even_exposure=false")},
    ),
    Perturbation(
        "bright inputs",
        _PART,
        "The views that the test predicts from are so many times as bright as the photographs that it is held against.",
        "times",
        (1, 1.25, 1.6, 2.5),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:brighter_inputs")),
        _BOTH,
    ),
    Perturbation(
        "wrong poses in the test",
        _PART,
        "The views that the test predicts from stand so far off where they are said to be, in parts of the height of flight.",
        "heights",
        (0, 0.003, 0.01, 0.03, 0.1),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:shifted_inputs")),
        _BOTH,
    ),
    Perturbation(
        "wrong slab",
        _PART,
        "The layer between ground and roofs is said to lie so many times its thickness higher.",
        "thicknesses",
        (0, 0.25, 0.5, 1, 2),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:raised_slab")),
        {**_BOTH, _ALONE: NO_SCAFFOLD},
    ),
    Perturbation(
        "wrong scaffold",
        _PART,
        "The depth that a prediction starts from lies so many times the slab's thickness too high.",
        "thicknesses",
        (0, 0.05, 0.1, 0.25, 0.5),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:raised_scaffold")),
        {_SWEEP: (), _ALONE: NO_SCAFFOLD},
    ),
    Perturbation(
        "holes in the scaffold",
        _PART,
        "This share of the depth that a prediction starts from is missing, in round places.",
        "share",
        (0, 0.1, 0.3, 0.6, 1),
        ABOVE_ONE_COLOUR,
        _learns(damage=Damage("dataset", f"{_PACKED}:torn_scaffold")),
        {_SWEEP: (), _ALONE: NO_SCAFFOLD},
    ),
    Perturbation(
        "few input views",
        _PART,
        "The model is trained and tested with this many input views.",
        "views",
        (9, 5, 3, 2, 1),
        ABOVE_ONE_COLOUR,
        _learns(_inputs, world=MANY_PHOTOS),
        _BOTH,
    ),
)
