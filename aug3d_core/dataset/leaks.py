"""The leak audit: what the model is tested on must not have reached what it is trained on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from aug3d_core.dataset.scene import RENDERED, SPLITS, Scene


def leaks(scene: Scene) -> list[str]:
    """Return a sentence for each way in which test photographs touch training; empty when there is none."""
    train, support, target = (SPLITS.index(role) for role in ("train", "support", "target"))
    found = []
    for name in ("real", "rendered"):
        used = np.unique(scene.groups[name])
        for view in used[scene.splits[used] != train]:
            found.append(f"training group set {name} holds {SPLITS[scene.splits[view]]} view {view}")
    test = scene.groups["test"]
    for view in np.unique(test[:, 0])[scene.splits[np.unique(test[:, 0])] != target]:
        found.append(f"test view {view} is {SPLITS[scene.splits[view]]}, not target")
    inputs = np.unique(test[:, 1:])
    for view in inputs[scene.splits[inputs] != support]:
        found.append(f"test input {view} is {SPLITS[scene.splits[view]]}, not support")
    if np.any(scene.source[np.unique(test)] == RENDERED):
        found.append("a test group holds a rendered view")
    return found


def mesh_leaks(scene: Scene, sources: Mapping[str, Iterable[int]]) -> list[str]:
    """Return a sentence for each photograph that a mesh was made of and must not be.

    `sources` holds photo ids: `mesh`, which training's views are rendered from, may hold train photos alone; `baseline`,
    which is compared with the model, any but the targets.
    """
    role = {int(photo): SPLITS[split] for photo, split in zip(scene.photo_id, scene.splits, strict=True) if photo >= 0}
    found = [
        f"the mesh of train photos was made of {role.get(photo, 'unknown')} photo {photo}"
        for photo in sources["mesh"]
        if role.get(photo) != "train"
    ]
    return found + [
        f"the mesh compared with the model was made of {role.get(photo, 'unknown')} photo {photo}"
        for photo in sources["baseline"]
        if role.get(photo) in (None, "target")
    ]
