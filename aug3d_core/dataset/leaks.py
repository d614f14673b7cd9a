"""The leak audit: what the model is tested on must not have reached what it is trained on.

It looks at the packed scene, at the sources of the meshes and at what each photograph sees, not at what the split meant to
do. Hard checks are of photographs in the wrong place: one that fails stops the stage. The others measure how much of the
test's ground training has seen from elsewhere; one that fails is told, and makes the figures of the test less certain.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import sparse

from aug3d_core.dataset.scene import RENDERED, SPLITS, Scene
from aug3d_core.geometry.footprint import footprints_apart

GAP = 1.0  # footprints between where training and a target look
SEEN_MEAN = 0.10  # of a target's points that training sees, over targets
SEEN_MAX = 0.50  # of any one target's points
TRAIN, SUPPORT, TARGET = (SPLITS.index(role) for role in ("train", "support", "target"))


@dataclass(frozen=True)
class Sight:
    """What the photographs see, in the order of the scene's real views.

    look_in_world: where each looks, NaN if it sees no point. footprint: how much ground, world units. visible: views x points.
    """

    look_in_world: Float[np.ndarray, "n 2"]
    footprint: Float[np.ndarray, " n"]
    visible: sparse.csr_array


@dataclass(frozen=True)
class Check:
    """One check: its figure, the bound that the figure must keep, and a sentence for each photograph in the wrong place."""

    name: str
    metric: str
    figure: float
    bound: float
    at_least: bool = False  # the bound is the least that the figure may be, not the most
    hard: bool = False
    found: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether the figure keeps its bound."""
        return self.figure >= self.bound if self.at_least else self.figure <= self.bound

    @property
    def rule(self) -> str:
        """The bound in words."""
        return f"at {'least' if self.at_least else 'most'} {self.bound:g}"


def audit(scene: Scene, sources: Mapping[str, Iterable[int]], sight: Sight) -> list[Check]:
    """Return every check. `sources` holds the ids of the photographs that shape and texture of each mesh were made of:
    `mesh`, which training's views are rendered from, and `baseline`, which is compared with the model.
    """
    role = _roles(scene)
    hard = (
        ("photos in training groups that are not for training", "leak_training_photos", _in_training(scene)),
        ("photos in test groups that are not for that", "leak_test_photos", _in_test(scene)),
        ("photos in training and in test", "leak_common_photos", _in_both(scene)),
        ("photos not for training in mesh or texture that is rendered", "leak_mesh_photos", _in_mesh(role, sources)),
        ("targets in mesh or texture to compare with", "leak_baseline_photos", _in_baseline(role, sources)),
    )
    counted = [Check(name, metric, len(found), 0, hard=True, found=tuple(found)) for name, metric, found in hard]
    return counted + _seen(scene, sight)


def report(checks: Iterable[Check], scene: Scene, sources: Mapping[str, Iterable[int]]) -> dict[str, Any]:
    """Return the audit as JSON takes it: the checks, the photographs of each role, and those that each mesh is made of."""
    checks = list(checks)
    return {
        "state": "pass" if all(check.passed for check in checks) else "doubtful",
        "checks": [
            {"check": c.name, "figure": c.figure, "bound": c.rule, "passed": c.passed, "hard": c.hard} for c in checks
        ],
        "photos": {
            role: scene.photo_id[(scene.splits == code) & (scene.source != RENDERED)].tolist()
            for code, role in enumerate(SPLITS)
        },
        "made_of": {mesh: list(photos) for mesh, photos in sources.items()},
        "rendered_from": "mesh",
    }


def _in_training(scene: Scene) -> list[str]:
    return [
        f"training group set {name} holds {SPLITS[scene.splits[view]]} view {view}"
        for name in ("real", "rendered")
        for view in np.unique(scene.groups[name])
        if scene.splits[view] != TRAIN
    ]


def _in_test(scene: Scene) -> list[str]:
    test = scene.groups["test"]
    return (
        [
            f"test view {view} is {SPLITS[scene.splits[view]]}, not target"
            for view in np.unique(test[:, 0])
            if scene.splits[view] != TARGET
        ]
        + [
            f"test input {view} is {SPLITS[scene.splits[view]]}, not support"
            for view in np.unique(test[:, 1:])
            if scene.splits[view] != SUPPORT
        ]
        + [f"test group holds rendered view {view}" for view in np.unique(test) if scene.source[view] == RENDERED]
    )


def _in_both(scene: Scene) -> list[str]:
    """Look at the ids of the photographs: one may be there twice, under two roles."""
    used = np.unique(np.concatenate([scene.groups[name].ravel() for name in ("real", "rendered")]))
    twice = np.intersect1d(scene.photo_id[used], scene.photo_id[np.unique(scene.groups["test"])])
    return [f"photo {photo} is in training and in test" for photo in twice if photo >= 0]


def _in_mesh(role: Mapping[int, str], sources: Mapping[str, Iterable[int]]) -> list[str]:
    return [
        f"the mesh of train photos was made of {role.get(photo, 'unknown')} photo {photo}"
        for photo in sources["mesh"]
        if role.get(photo) != "train"
    ]


def _in_baseline(role: Mapping[int, str], sources: Mapping[str, Iterable[int]]) -> list[str]:
    return [
        f"the mesh compared with the model was made of {role.get(photo, 'unknown')} photo {photo}"
        for photo in sources["baseline"]
        if role.get(photo) in (None, "target")
    ]


def _roles(scene: Scene) -> dict[int, str]:
    return {int(photo): SPLITS[code] for photo, code in zip(scene.photo_id, scene.splits, strict=True) if photo >= 0}


def _seen(scene: Scene, sight: Sight) -> list[Check]:
    """Measure how far training's photographs look from the targets, and how much of what those see they see too."""
    sighted = np.isfinite(sight.look_in_world).all(axis=1)
    trained = np.intersect1d(np.unique(scene.groups["real"]), np.flatnonzero(sighted))
    targets = np.intersect1d(np.unique(scene.groups["test"][:, 0]), np.flatnonzero(sighted))
    nearest, seen = np.zeros(1), np.ones(1)  # nothing is known to be apart of what sees nothing
    if len(trained) and len(targets):
        nearest = footprints_apart(sight.look_in_world, sight.footprint, trained, targets).min(axis=1)
        by_training = (sight.visible[trained].sum(axis=0) > 0).astype(np.int32)
        seen = (sight.visible[targets] @ by_training) / sight.visible[targets].sum(axis=1)
    measured = (
        ("footprints from a target to the nearest training photo", "leak_gap_footprints_min", nearest.min(), GAP, True),
        (
            "footprints from training photos to the nearest target, median",
            "leak_gap_footprints_median",
            np.median(nearest),
            GAP,
            True,
        ),
        (
            "share of a target's points that training sees, mean",
            "leak_seen_share_mean",
            seen.mean(),
            SEEN_MEAN,
            False,
        ),
        (
            "share of a target's points that training sees, largest",
            "leak_seen_share_max",
            seen.max(),
            SEEN_MAX,
            False,
        ),
    )
    return [
        Check(name, metric, round(float(figure), 4), bound, at_least)
        for name, metric, figure, bound, at_least in measured
    ]
