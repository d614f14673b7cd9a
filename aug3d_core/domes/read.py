"""What the sampling stage reads, checked: bad input is refused here."""

from __future__ import annotations

import numpy as np
import pandas as pd

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Inputs
from aug3d_core.sfm.files import VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import MESH


def read_mesh(inputs: Inputs) -> Mesh:
    """Return the mesh of train photos; raises InputError where it is empty or not finite."""
    mesh = Mesh.load(inputs["surface"] / MESH)
    if not len(mesh.triangles):
        raise InputError(f"surface/{MESH} has no triangles", "take more photos, or look at the surface stage")
    if not np.isfinite(mesh.xyz).all():
        bad = int((~np.isfinite(mesh.xyz)).any(axis=1).sum())
        raise InputError(
            f"surface/{MESH} has {bad} vertices without a finite place", "make the surface again from the photos"
        )
    return mesh


def train_photos(inputs: Inputs) -> Views:
    """Return the views of train photos; raises InputError where one has no finite pose."""
    views = Views.load(inputs["sfm"] / VIEWS)
    split = pd.read_parquet(inputs["grouping"] / SPLIT_TABLE)
    train = views.take(np.sort(split["view"].to_numpy()[split["role"].astype(str) == "train"]))
    posed = np.isfinite(train.cam_from_world).all(axis=(1, 2)) & np.isfinite(train.intrinsics).all(axis=1)
    if not posed.all():
        raise InputError(
            f"sfm/{VIEWS} has no finite pose for photo {train.photo_id[~posed][0]}",
            "leave that photo out, or let the sfm stage find the poses",
        )
    return train


def views_per_dome(inputs: Inputs, config: SamplingConfig) -> int:
    """Return how many views each dome is to have: the members of a training group, unless the user wants more.

    Raises InputError if the user wants fewer: a dome is packed as a training group, or not at all.
    """
    with np.load(inputs["grouping"] / GROUPS, allow_pickle=False) as groups:
        members = int(groups["members"].shape[1])
    wanted = config.views_per_dome
    if wanted is not None and wanted < members:
        raise InputError(
            f"sampling.views_per_dome={wanted} is less than the {members} members of a training group (K)",
            f"ask for {members} views or more, leave it empty, or set grouping.k={wanted}",
        )
    return wanted or members
