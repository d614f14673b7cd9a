"""The leak audit: what the model is tested on must not have reached what it is trained on."""

from __future__ import annotations

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
