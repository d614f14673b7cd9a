"""What a way of grouping may look at. Each way is a module with one function:

    group(scene, candidates, k, count, config, rng) -> members (C, K)

`candidates` are the views (indices) that may be used, at least K of them; `count` is the number of groups wanted, C <=
count the number made; row c holds the views of group c, its centre first, none twice. A way that leaves candidates out
has a second function, which tells why: excluded(scene, candidates, k) -> {reason: views}.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.geometry.ground_model import GroundModel, fit_ground
from aug3d_core.geometry.shared_points import share
from aug3d_core.geometry.views import Views
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.surface_cells import seen_cells
from aug3d_core.groups.twins import twins
from aug3d_core.run.errors import InputError


@dataclass(frozen=True)
class GroupingScene:
    """Views, what they share, and where they look.

    shared: points that each pair of views shares (n x n). look_in_world: mean ground position of what a view sees.
    points_in_world: the triangulated points. Raises InputError on a pose that is not finite.
    """

    views: Views
    shared: sparse.csr_array
    look_in_world: Float[np.ndarray, "n 2"]
    points_in_world: Float[np.ndarray, "p 3"]

    def __post_init__(self) -> None:
        finite = np.isfinite(self.views.cam_from_world).all(axis=(1, 2))
        if not finite.all():
            raise InputError(
                f"the pose of photo {self.views.photo_id[np.argmin(finite)]} is not finite",
                "Run sfm again; if the poses were imported, correct that one.",
            )

    @cached_property
    def ground(self) -> GroundModel:
        """The ground under the points; raises InputError where there is none."""
        return fit_ground(self.points_in_world, np.random.default_rng(0))

    @cached_property
    def shared_share(self) -> sparse.csr_array:
        """Shared points over the geometric mean of the points that each view of a pair sees (n x n), 0 to 1."""
        return share(self.shared)

    @cached_property
    def seen(self) -> sparse.csr_array:
        """What part of the surface each view sees (n x cubes), as `seen_cells` tells it."""
        try:
            ground = self.ground
        except InputError:
            ground = None
        return seen_cells(self.views, self.points_in_world, ground)

    @cached_property
    def seen_share(self) -> sparse.csr_array:
        """How much of the same surface each pair of views shows, as shares of their pictures (n x n), 0 to 1."""
        return share(sparse.csr_array(self.seen @ self.seen.T))

    @cached_property
    def twins(self) -> list[list[int]]:
        """For each view, the others that were taken in the same pose."""
        height = np.median(self.points_in_world[:, 2]) if len(self.points_in_world) else 0.0
        return twins(self.views, np.column_stack([self.look_in_world, np.full(len(self.views), height)]))


Group = Callable[
    [GroupingScene, Int[np.ndarray, " m"], int, int, GroupingConfig, np.random.Generator], Int[np.ndarray, "c k"]
]
Excluded = Callable[[GroupingScene, Int[np.ndarray, " m"], int], dict[str, Int[np.ndarray, " x"]]]
