"""The slab: the layer between ground and roofs in which everything that a view shows lies.

The ground is a plane z = a x + b y + c; a point's height is measured along z above it. The slab is the heights from
`low` to `high`. A ray is origin + t direction; where a direction's camera z is 1, t is the distance along that z.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Float

GROUND_QUANTILE = 0.25  # of heights: low enough to be ground among roofs, high enough to miss points under the ground
_ROUNDS = 100  # of the fit of the plane


@dataclass(frozen=True)
class Slab:
    """Ground plane z = a x + b y + c, and the lowest and highest height above it, in world units."""

    a: float
    b: float
    c: float
    low: float
    high: float

    def height(self, points_in_world: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"] | float:
        """Return heights above the ground plane, a number for a single point."""
        x, y, z = np.moveaxis(points_in_world, -1, 0)
        return z - (self.a * x + self.b * y + self.c)

    def meet(
        self, origins: Float[np.ndarray, "*n 3"], directions: Float[np.ndarray, "*n 3"], height: float
    ) -> Float[np.ndarray, "*n"]:
        """Return the t at which rays meet a height; infinite where they never do."""
        rise = directions[..., 2] - (self.a * directions[..., 0] + self.b * directions[..., 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (height - self.height(origins)) / rise
        return np.where((t > 0) & np.isfinite(t), t, np.inf)

    def span(
        self,
        origins: Float[np.ndarray, "*n 3"],
        directions: Float[np.ndarray, "*n 3"],
        near: Float[np.ndarray, "*n"],
        far: Float[np.ndarray, "*n"],
    ) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
        """Return (t in, t out) of rays within the slab, inside the bounds given; the bounds where a ray misses it."""
        top, bottom = self.meet(origins, directions, self.high), self.meet(origins, directions, self.low)
        inside = (self.height(origins) > self.low) & (self.height(origins) < self.high)
        start = np.clip(np.where(inside, 0.0, np.minimum(top, bottom)), near, far)
        end = np.clip(np.where(inside, np.minimum(top, bottom), np.maximum(top, bottom)), near, far)
        missed = end <= start
        return np.where(missed, near, start), np.where(missed, far, end)

    def as_dict(self) -> dict[str, float]:
        """Return the five numbers by name."""
        return asdict(self)


def slab_of(points_in_world: Float[np.ndarray, "p 3"], outlier_share: float, margin_share: float) -> Slab:
    """Fit the ground plane and the range of heights of a scene's sparse points."""
    a, b, c = _ground_plane(points_in_world)
    flat = Slab(a, b, c, 0.0, 0.0)
    low, high = np.quantile(flat.height(points_in_world), [outlier_share, 1 - outlier_share])
    margin = margin_share * max(high - low, 1e-6)
    return Slab(a, b, c, float(low - margin), float(high + margin))


def _ground_plane(points_in_world: Float[np.ndarray, "p 3"]) -> tuple[float, float, float]:
    """Fit z = a x + b y + c with a share GROUND_QUANTILE of points below it (quantile regression, reweighted)."""
    middle = np.median(points_in_world, axis=0)
    xyz = points_in_world - middle
    design = np.column_stack([xyz[:, :2], np.ones(len(xyz))])
    spread = np.std(xyz[:, 2]) + 1e-9
    plane = np.array([0.0, 0.0, np.quantile(xyz[:, 2], GROUND_QUANTILE)])
    for _ in range(_ROUNDS):
        residual = xyz[:, 2] - (plane[0] * xyz[:, 0] + plane[1] * xyz[:, 1] + plane[2])
        weight = np.where(residual > 0, GROUND_QUANTILE, 1 - GROUND_QUANTILE) / np.maximum(abs(residual), 0.01 * spread)
        # Without BLAS: the same bits on any number of cores
        square = np.einsum("pi,pj->ij", design * weight[:, None], design)
        plane = np.linalg.lstsq(square, np.einsum("pi,p->i", design, weight * xyz[:, 2]), rcond=None)[0]
    a, b, c = plane
    return float(a), float(b), float(c + middle[2] - a * middle[0] - b * middle[1])
