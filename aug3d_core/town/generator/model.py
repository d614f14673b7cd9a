"""Triangles with texture, collected piece by piece.

Lengths in metres, z up; corners run counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

_UNIT = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


@dataclass(frozen=True)
class TexturedMesh:
    """Triangles whose corners carry texture coordinates of their own (0..1, v up)."""

    vertices: Float[np.ndarray, "v 3"]
    triangles: Int[np.ndarray, "t 3"]
    uv: Float[np.ndarray, "t 3 2"]


@dataclass(frozen=True)
class Frame:
    """A place on the ground: local x, y are turned by `yaw_rad` and moved."""

    x: float
    y: float
    yaw_rad: float

    def place(self, local: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Map local points to the town."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return local @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + np.array([self.x, self.y, 0.0])


@dataclass
class Model:
    """A growing mesh; every triangle points into a patch of an atlas."""

    vertices: list[np.ndarray] = field(default_factory=list)
    triangles: list[np.ndarray] = field(default_factory=list)
    patches: list[np.ndarray] = field(default_factory=list)
    uvs: list[np.ndarray] = field(default_factory=list)
    count: int = 0

    def add(
        self,
        vertices: Float[np.ndarray, "v 3"],
        triangles: Int[np.ndarray, "t 3"],
        patch: Int[np.ndarray, " t"] | int,
        uv: Float[np.ndarray, "t 3 2"],
    ) -> None:
        """Append triangles; `uv` is within the patch (0..1, v up)."""
        self.vertices.append(np.asarray(vertices, float))
        self.triangles.append(np.asarray(triangles) + self.count)
        self.patches.append(np.broadcast_to(patch, len(triangles)))
        self.uvs.append(np.asarray(uv, float))
        self.count += len(vertices)

    def polygon(
        self, frame: Frame, corners: Sequence[Sequence[float]], patch: int, uv: Sequence[Sequence[float]] = _UNIT
    ) -> None:
        """Append a convex polygon given by its local corners."""
        n = len(corners)
        fan = np.array([[0, i, i + 1] for i in range(1, n - 1)])
        self.add(frame.place(np.array(corners, float)), fan, patch, np.array(uv, float)[fan])

    def box(
        self, frame: Frame, low: Sequence[float], high: Sequence[float], side: int, top: int, taper: float = 0.0
    ) -> None:
        """Append a box without a bottom; `taper` (m) narrows the top on every side."""
        (x0, y0, z0), (x1, y1, z1), t = low, high, taper
        base = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
        lid = [(x0 + t, y0 + t, z1), (x1 - t, y0 + t, z1), (x1 - t, y1 - t, z1), (x0 + t, y1 - t, z1)]
        for i in range(4):
            j = (i + 1) % 4
            self.polygon(frame, [base[i], base[j], lid[j], lid[i]], side)
        self.polygon(frame, lid, top)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices, triangles, patch per triangle, and coordinates within the patch."""
        return (
            np.concatenate(self.vertices),
            np.concatenate(self.triangles),
            np.concatenate(self.patches),
            np.concatenate(self.uvs),
        )
