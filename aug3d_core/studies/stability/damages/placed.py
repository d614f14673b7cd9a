"""Damage to what stands where: the whole world in another unit, domes that sink, photographs of the test that leak."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.domes.cameras import Cameras
from aug3d_core.domes.files import CAMERAS, DOME_TABLE
from aug3d_core.geometry.views import Points, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.sfm.files import POINTS, VIEWS
from aug3d_core.surface.files import MESH_SOURCES


def scaled(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Tell poses and points in a unit of which this many make a metre."""
    views, points = Views.load(folder / VIEWS), Points.load(folder / POINTS)
    poses = views.cam_from_world.copy()
    poses[:, :, 3] *= dose
    replace(views, cam_from_world=poses).save(folder / VIEWS)
    replace(points, xyz=points.xyz * dose).save(folder / POINTS)


def sunk(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Lower every dome by this share of how high its lowest camera stands over what the dome looks at."""
    cameras = Cameras.load(folder / CAMERAS)
    domes = pd.read_parquet(folder / DOME_TABLE)
    aim_z = domes[domes["dome_id"] >= 0].set_index("dome_id")["z"].reindex(cameras.dome_id).to_numpy(float)
    poses = cameras.world_from_cam.copy()
    above = pd.Series(poses[:, 2, 3] - aim_z).groupby(cameras.dome_id).transform("min").to_numpy()
    poses[:, 2, 3] -= dose * above
    replace(cameras, world_from_cam=poses).save(folder / CAMERAS)


def leaked_into_groups(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Put so many photographs of the test block into training groups, each in the place of a member."""
    with np.load(folder / GROUPS, allow_pickle=False) as file:
        members, test_members = file["members"], file["test_members"]
    leaked = rng.permutation(np.unique(test_members))[: round(dose)]
    rows = np.arange(len(leaked)) % len(members)
    members[rows, members.shape[1] - 1 - np.arange(len(leaked)) // len(members)] = leaked
    with (folder / GROUPS).open("wb") as file:
        np.savez(file, members=members, test_members=test_members)


def leaked_into_mesh(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Say of the rendered mesh that so many photographs not for training shaped and coloured it, as it would itself."""
    path = folder / MESH_SOURCES
    sources = json.loads(path.read_text())
    others = sorted(set(sources["baseline"]) - set(sources["mesh"]))
    path.write_text(json.dumps({**sources, "mesh": [*sources["mesh"], *others[: round(dose)]]}))
