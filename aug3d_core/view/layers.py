"""What stands in the three-dimensional scene: mesh, points, cameras, test views, virtual domes, the path of a film."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from jaxtyping import Float, UInt8

from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.geometry.views import Views
from aug3d_core.view.colours import DOME, TARGET
from aug3d_core.view.finished import Finished
from aug3d_core.view.poses import Pose, fov_of, to_browser

MESH, POINTS, PHOTOS, TESTS, DOMES = "mesh", "points", "cameras", "test views", "virtual domes"
SHOWN_AT_FIRST = {MESH: True, PHOTOS: True, TESTS: True}
_MOST_FRUSTUMS = 1000  # above this, only every n-th camera is drawn, and all test views
_MOST_POINTS = 500_000
_FRUSTUM, _LINE_PX = 0.05, 2.0  # length of a drawn camera, in distances to the ground; width of its lines
_POINT = 0.002  # size of a point, likewise
_WORLD_FROM_GLTF_WXYZ = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)  # y up -> z up
_AMBIENT = float(np.pi)  # makes a matt surface as bright as its texture
_FIRST_UP, _FIRST_ASIDE = (
    1.3,
    0.35,
)  # of the height: where the first camera stands, above the others and beside the middle
_PATH_RGB = (255, 193, 7)


@dataclass(frozen=True)
class Layers:
    """The handles of all that can be shown and hidden, and of each camera by row."""

    parts: Mapping[str, Sequence[Any]]
    cameras: Mapping[int, viser.CameraFrustumHandle]

    def paint(self, rgb: UInt8[np.ndarray, "n 3"]) -> None:
        """Give cameras their colours, by row."""
        for row, handle in self.cameras.items():
            r, g, b = map(int, rgb[row])
            handle.color = (r, g, b)


def show(handles: Sequence[Any], visible: bool) -> None:
    """Show or hide a layer."""
    for handle in handles:
        handle.visible = visible


def pose_of(views: Views, row: int) -> Float[np.ndarray, "4 4"]:
    """Return the `world_from_cam` of a photograph."""
    return homogeneous(invert(views.cam_from_world[row]))


def look(server: viser.ViserServer, shown: Finished) -> Pose:
    """Put the first camera a little above the others, looking at the middle of the scene at a slant, and return it."""
    eyes = invert(shown.views.cam_from_world)[..., 3]
    height = _height(shown)
    spot = np.median(eyes, axis=0) + height * np.median(shown.views.cam_from_world[:, 2, :3], axis=0)
    eye = spot + height * np.array([0, -_FIRST_ASIDE, _FIRST_UP])
    fov_rad = fov_of(np.median(shown.views.intrinsics, axis=0), float(np.median(shown.views.size[:, 1])))
    first = server.initial_camera
    first.position, first.look_at = eye - shown.middle_in_world, spot - shown.middle_in_world
    first.fov, first.near, first.far = fov_rad, 0.01 * height, 100 * height
    return Pose(homogeneous(invert(look_at(eye, spot))), fov_rad)


def draw(server: viser.ViserServer, shown: Finished, clicked: Callable[[int], None]) -> Layers:
    """Draw everything. clicked: is called with the row of a camera that was clicked."""
    scene = server.scene
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(hdri=None)
    scene.add_light_ambient("/light", intensity=_AMBIENT)
    height = _height(shown)
    cameras = {row: _camera(server, shown, row, _FRUSTUM * height, clicked) for row in _rows(shown)}
    parts: dict[str, Sequence[Any]] = {}
    if shown.mesh_glb:
        mesh = scene.add_glb(
            "/mesh", shown.mesh_glb, wxyz=_WORLD_FROM_GLTF_WXYZ, cast_shadow=False, receive_shadow=False
        )
        parts[MESH] = [mesh]
    step = -(-len(shown.points.xyz) // _MOST_POINTS) or 1
    cloud = scene.add_point_cloud(
        "/points",
        (shown.points.xyz[::step] - shown.middle_in_world).astype(np.float32),
        shown.points.rgb[::step],
        point_size=_POINT * height,
        precision="float32",
        visible=not shown.mesh_glb,
    )
    parts[POINTS] = [cloud]
    parts[PHOTOS] = [handle for row, handle in cameras.items() if shown.roles[row] != TARGET]
    if tests := [handle for row, handle in cameras.items() if shown.roles[row] == TARGET]:
        parts[TESTS] = tests
    if shown.domes is not None:
        parts[DOMES] = [_domes(server, shown, _FRUSTUM * height / 2)]
    return Layers(parts, cameras)


def draw_path(server: viser.ViserServer, keys: Sequence[Pose], shown: Finished) -> None:
    """Draw straight lines from key view to key view, in place of those before."""
    server.scene.remove_by_name("/path")
    if len(keys) > 1:
        at = np.stack([key.world_from_cam[:3, 3] for key in keys]) - shown.middle_in_world
        pairs = np.stack([at[:-1], at[1:]], axis=1).astype(np.float32)
        server.scene.add_line_segments("/path", pairs, _PATH_RGB, thickness=_LINE_PX, thickness_units="screen")


def _height(shown: Finished) -> float:
    """Return how far the points usually lie below the cameras."""
    eyes = invert(shown.views.cam_from_world)[..., 3]
    below = np.median(eyes[:, 2]) - np.median(shown.points.xyz[:, 2]) if len(shown.points.xyz) else 0.0
    return float(below) if below > 0 else float(np.linalg.norm(np.ptp(eyes, axis=0))) or 1.0


def _rows(shown: Finished) -> list[int]:
    step = -(-len(shown.views) // _MOST_FRUSTUMS)
    return [row for row in range(len(shown.views)) if row % step == 0 or shown.roles[row] == TARGET]


def _camera(
    server: viser.ViserServer, shown: Finished, row: int, scale: float, clicked: Callable[[int], None]
) -> viser.CameraFrustumHandle:
    views = shown.views
    wxyz, position = to_browser(pose_of(views, row), shown.middle_in_world)
    width, height = map(float, views.size[row])
    handle = server.scene.add_camera_frustum(
        f"/cameras/{row}",
        fov_of(views.intrinsics[row], height),
        width / height,
        scale=scale,
        thickness=_LINE_PX,
        thickness_units="screen",
        wxyz=wxyz,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )
    handle.on_click(lambda _: clicked(row))
    return handle


def _domes(server: viser.ViserServer, shown: Finished, scale: float) -> viser.LineSegmentsHandle:
    """Draw all virtual cameras as one thing: there are many, and none is clicked."""
    assert shown.domes is not None
    lines = outlines(shown.domes.world_from_cam, shown.domes.intrinsics, shown.domes.size, scale)
    return server.scene.add_line_segments(
        "/domes",
        (lines - shown.middle_in_world).astype(np.float32),
        DOME,
        thickness=1.0,
        thickness_units="screen",
        visible=False,
    )


def outlines(
    world_from_cam: Float[np.ndarray, "m 4 4"],
    intrinsics: Float[np.ndarray, "m 4"],
    size_px: np.ndarray,
    scale: float,
) -> Float[np.ndarray, "l 2 3"]:
    """Return the eight edges of each camera's pyramid, `scale` deep, as lines in the world."""
    corners_px = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size_px[:, None]
    in_cam = (corners_px - intrinsics[:, None, 2:]) / intrinsics[:, None, :2]
    in_cam = scale * np.concatenate([in_cam, np.ones((*in_cam.shape[:2], 1))], axis=2)
    eyes = world_from_cam[:, None, :3, 3]
    corners = np.einsum("mij,mkj->mki", world_from_cam[:, :3, :3], in_cam) + eyes
    sides = np.stack([np.broadcast_to(eyes, corners.shape), corners], axis=2)
    front = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    return np.concatenate([sides, front], axis=1).reshape(-1, 2, 3)
