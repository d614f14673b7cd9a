"""A short flight rendered by the model: once around a test camera, within reach of its inputs, which stay the same.

With it, from the same inputs: the depth that the model predicts and the homography over the ground. There is no truth to fly
through, so this is for the eye; it enters no score.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.dataset.new_views import facing, only, with_scaffold, with_views
from aug3d_core.dataset.projection import middle_ground
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.head import Head, View
from aug3d_core.judging.cheap_answers import ground_homography
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.panels import depth_colours, grid

REACH = 0.5  # radius of the flight, share of the middle distance from the test camera to its inputs
FRAMES_PER_SECOND = 8


def fly(
    head: Head, scene: Scene, target: int, inputs: Int[np.ndarray, " v"], config: EvaluationConfig
) -> list[UInt8[np.ndarray, "H W 3"]]:
    """Render the frames of a flight that ends where it began."""
    intrinsics = scene.intrinsics[target]
    poses = around(scene, target, inputs, config.flythrough_frames)
    seen = np.arange(len(inputs))
    small, frames = with_views(only(scene, inputs), poses, intrinsics, seen)
    small = with_scaffold(small, frames, seen)
    views = [head.predict_bare(small, int(frame), seen) for frame in frames]
    depths = [one.depth for one in views if one.depth is not None]
    bounds = (
        tuple(np.quantile(np.stack(depths), [0.01, 0.99])) if depths else None
    )  # of all frames: depth does not flicker
    return [
        grid([[*_of_head(head, one, bounds), ("ground homography", ground_homography(small, int(frame), seen))]])
        for frame, one in zip(frames, views, strict=True)
    ]


def _of_head(head: Head, view: View, bounds: tuple[float, float] | None) -> list[tuple[str, np.ndarray]]:
    depth = [] if view.depth is None else [("its depth", depth_colours(view.depth, bounds))]
    return [(head.config.title, view.colour), *depth]


def around(scene: Scene, target: int, inputs: Int[np.ndarray, " v"], frames: int) -> Float[np.ndarray, "f 4 4"]:
    """Return the poses of a circle around a camera in the plane of its image, all looking at what it looks at."""
    right, down, _, eye = scene.world_from_cam[target, :3].T
    radius = REACH * np.median(np.linalg.norm(scene.world_from_cam[inputs, :3, 3] - eye, axis=1))
    spot = middle_ground(scene, target)
    turn = np.linspace(0, 2 * np.pi, frames, endpoint=False)
    eyes = eye + radius * (np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * down)
    return np.stack([facing(place, spot, -down) for place in eyes])
