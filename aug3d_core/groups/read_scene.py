"""Read what grouping may look at from the files of earlier stages."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from aug3d_core.geometry.shared_points import look_positions
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.files import SHARED_POINTS
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.run.stage import Inputs
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS


def read_scene(inputs: Inputs) -> GroupingScene:
    """Return the scene that the stages sfm and similarity wrote.

    A view that sees no point keeps its place in the files; it looks straight down, for want of better.
    """
    views = Views.load(inputs["sfm"] / VIEWS)
    points = Points.load(inputs["sfm"] / POINTS)
    tracks = Tracks.load(inputs["sfm"] / TRACKS)
    shared = sparse.csr_array(sparse.load_npz(inputs["similarity"] / SHARED_POINTS))
    look, seen = look_positions(tracks, points.xyz, len(views))
    look = np.where((seen > 0)[:, None], look, centres(views.cam_from_world)[:, :2])
    return GroupingScene(views, shared, look, points.xyz)
