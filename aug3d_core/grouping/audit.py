"""Figures that say how good groups and split are."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.grouping.split import Role, Split


def shared_within(shared: sparse.csr_array, members: Int[np.ndarray, "c k"]) -> Int[np.ndarray, "c k-1"]:
    """Return the points that each member shares with its group's centre."""
    centres = np.repeat(members[:, 0], members.shape[1] - 1)
    return np.asarray(shared[centres, members[:, 1:].ravel()]).reshape(len(members), -1)


def leak_shared_share(visible: sparse.csr_array, split: Split) -> Float[np.ndarray, " m"]:
    """Return, for each training view, the largest share of its points that any single target sees too."""
    train, targets = split.views(Role.TRAIN), split.views(Role.TARGET)
    common = (visible[train] @ visible[targets].T).toarray()
    return common.max(axis=1) / np.maximum(visible[train].sum(axis=1), 1)
