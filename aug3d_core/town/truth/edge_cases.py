"""The paper's three edge cases of grouping (its figure of cluster methods) as small worlds that are known exactly.

* Abrupt turn: lines flown to and fro, the camera looking well ahead. Along a line ten photographs in a row overlap; across a
  turn the camera looks the other way at once.
* Near cameras that look apart: squares side by side, each photographed by a ring of cameras that look inwards. The rings
  interleave, so the nearest cameras look at different squares, and those that look the same way stand around other squares.
* High-rise: slabs higher than the flight, photographed from both sides. The central rays of both sides meet the ground at the
  foot of the slab, having passed through it; but each side sees its own walls.

Each takes the measure by which it grows: turns, angle, height. Without one it is the case as the benchmark shows it.

What two views share is counted exactly: points spread over the surface that both see, with occlusion, as if structure from
motion found each of them in every photograph that shows it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.shared_points import look_positions, shared_points, visibility
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.overlap.true_overlap import visible
from aug3d_core.town.truth.patchwork import block, ground, patchwork
from aug3d_core.town.truth.surface_samples import sample_surface

K = 10
_POINTS = 20_000
_SIZE = (160, 120)  # px
_SEED = 0
_SHAKEN_M, _SHAKEN_DEG = 0.5, 1.0


@dataclass(frozen=True)
class EdgeCase:
    """A world, a flight, and the ways of grouping that should go wrong on it."""

    name: str
    fails: tuple[str, ...]
    mesh: Mesh
    views: Views

    @property
    def key(self) -> str:
        """The name as part of the name of a figure."""
        return self.name.replace(", ", "_").replace(" ", "_").replace("-", "_")


def edge_cases() -> tuple[EdgeCase, ...]:
    """Return the three cases; always the same."""
    return abrupt_turn(), looking_apart(), high_rise()


def abrupt_turn(per_line: int = 12) -> EdgeCase:
    """Fly lines east and west in turn, 12 m apart, with a photograph every 6 m, looking 50 degrees ahead of straight down.

    There are about 72 photographs, `per_line` on each line: the fewer, the more turns lie within ten in a row.
    """
    poses, altitude, ahead = [], 50.0, 50.0 * np.tan(np.radians(50))
    lines, half_x = round(72 / per_line), 3.0 * (per_line - 1)
    half_y = 6.0 * (lines - 1)
    for line in range(lines):
        sense = 1.0 if line % 2 == 0 else -1.0
        for x in sense * np.linspace(-half_x, half_x, per_line):
            eye = np.array([x, 12.0 * line - half_y, altitude])
            poses.append(look_at(eye, eye + np.array([sense * ahead, 0.0, -altitude])))
    return EdgeCase("abrupt turn", ("sequence",), _world([ground(207 + half_x, 130 + half_y)]), _views(poses, 130.0))


def looking_apart(inwards_deg: float = 45.0) -> EdgeCase:
    """Ring each of 3 x 3 squares, 44 m apart, with ten cameras at 40 m that look at its middle, this far from straight down.

    The farther, the wider the rings: beyond 29 degrees neighbouring rings cross.
    """
    poses, out = [], np.tan(np.radians(inwards_deg))
    for square in [np.array([x, y, 0.0]) for y in (-44.0, 0.0, 44.0) for x in (-44.0, 0.0, 44.0)]:
        for turn in np.arange(K) * 2 * np.pi / K:
            poses.append(look_at(square + 40 * np.array([out * np.cos(turn), out * np.sin(turn), 1.0]), square))
    return EdgeCase("near, looking apart", ("grid_any_angle", "grid"), _world([ground(140, 140)]), _views(poses, 260.0))


def high_rise(height_m: float = 70.0) -> EdgeCase:
    """Fly along a row of slabs on both sides, 45 m high and 45 m away, looking at the foot of the row."""
    slabs = [part for x in (-62.0, 0.0, 62.0) for part in block((x, 0.0), (56.0, 14.0, height_m))]
    poses = []
    for side in (-1.0, 1.0):
        for x in side * np.linspace(-75.0, 75.0, 30):
            poses.append(look_at(np.array([x, 45 * side, 45.0]), np.array([x, 0.0, 0.0])))
    return EdgeCase("high-rise", ("ray",), _world([ground(160, 140), *slabs]), _views(poses, 130.0))


def shaken(case: EdgeCase, rng: np.random.Generator) -> EdgeCase:
    """Return the case flown again, as a drone flies: half a metre and a degree off here and there."""
    views = case.views
    at = centres(views.cam_from_world) + rng.normal(0.0, _SHAKEN_M, (len(views), 3))
    turned = Rotation.from_rotvec(rng.normal(0.0, _SHAKEN_DEG, (len(views), 3)), degrees=True)
    rotation = turned.as_matrix() @ views.cam_from_world[..., :3]
    poses = np.concatenate([rotation, -rotation @ at[..., None]], axis=-1)
    return replace(case, views=replace(views, cam_from_world=poses))


def exact_scene(case: EdgeCase, surface: Raycaster) -> GroupingScene:
    """Return what grouping may look at, counted exactly."""
    points = sample_surface(case.mesh, _POINTS, np.random.default_rng(_SEED))
    point, view = np.nonzero(visible(case.views, surface, points).T)
    tracks = Tracks(point, view, np.zeros((len(view), 2)))
    n = len(case.views)
    look, seen = look_positions(tracks, points, n)
    assert (seen > 0).all(), "every camera of an edge case sees the surface"
    return GroupingScene(case.views, shared_points(visibility(tracks, n, len(points))), look, points)


def _world(rectangles: Iterable[Float[np.ndarray, "3 3"]]) -> Mesh:
    return patchwork(rectangles, np.random.default_rng(_SEED))


def _views(poses: list[Float[np.ndarray, "3 4"]], focal_px: float) -> Views:
    n, (width, height) = len(poses), _SIZE
    intrinsics = np.tile([focal_px, focal_px, width / 2, height / 2], (n, 1))
    return Views(np.arange(n), np.stack(poses), intrinsics, np.tile(_SIZE, (n, 1)))
