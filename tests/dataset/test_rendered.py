import numpy as np
import pandas as pd
import pytest

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.rendered import pack_rendered
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.transforms import homogeneous, invert, look_at

DOMES, MEMBERS, WIDTH, HEIGHT = 3, 4, 12, 8
CONFIG = DatasetConfig(width_px=WIDTH, height_px=HEIGHT)


@pytest.fixture
def stages(tmp_path):
    """Three domes of four views in two shards; every pixel holds its view_id; view_ids are shuffled on disk."""
    (tmp_path / "shards").mkdir()
    ids = np.random.default_rng(0).permutation(DOMES * MEMBERS)
    pose = homogeneous(invert(look_at(np.array([0.0, 0, 50]), np.zeros(3))))
    poses = np.stack([pose + np.pad([[i]], ((0, 3), (3, 0))) for i in ids])
    lens, size = np.tile([10.0, 10, 6, 4], (len(ids), 1)), np.tile([WIDTH, HEIGHT], (len(ids), 1))
    np.savez(
        tmp_path / "cameras.npz", view_id=ids, dome_id=ids // MEMBERS, world_from_cam=poses, intrinsics=lens, size=size
    )
    rows = []
    for shard, part in enumerate(np.array_split(ids, 2)):
        rgb = np.tile(part[:, None, None, None].astype(np.uint8), (1, HEIGHT, WIDTH, 3))
        depth = np.full(rgb.shape[:3], 50, np.float16)
        np.savez(
            tmp_path / f"shards/{shard:04d}.npz",
            view_id=part,
            rgb=rgb,
            alpha=np.full(rgb.shape[:3], 255, np.uint8),
            depth=depth,
        )
        rows += [
            {"view_id": i, "dome_id": i // MEMBERS, "shard": shard, "row": r, "kept": True} for r, i in enumerate(part)
        ]
    pd.DataFrame(rows).to_parquet(tmp_path / "renders.parquet")
    return tmp_path


def drop(stages, *view_ids: int) -> None:
    table = pd.read_parquet(stages / "renders.parquet")
    table.loc[table["view_id"].isin(view_ids), "kept"] = False
    table.to_parquet(stages / "renders.parquet")


def pack(stages):
    return pack_rendered(stages, stages, MEMBERS, Slab(0.0, 0.0, 0.0, 0.0, 5.0), CONFIG)


def test_views_come_dome_after_dome_each_with_its_own_camera(stages):
    views = pack(stages)
    assert views.images[:, 0, 0, 0].tolist() == list(range(DOMES * MEMBERS))
    assert views.world_from_cam[:, 0, 3].tolist() == list(range(DOMES * MEMBERS))
    assert views.dome_id.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert views.domes_dropped == 0


def test_a_dome_that_lost_a_view_is_no_group(stages):
    drop(stages, 5)
    views = pack(stages)
    assert views.dome_id.tolist() == [0] * 4 + [2] * 4
    assert views.domes_dropped == 1


def test_no_dome_left_is_no_views(stages):
    drop(stages, 0, 4, 8)
    views = pack(stages)
    assert views.images.shape == (0, HEIGHT, WIDTH, 3)
    assert views.near_far.shape == (0, 2)
    assert views.domes_dropped == DOMES


def test_a_plan_without_views_is_no_views_and_no_dome_is_missed(stages):
    with np.load(stages / "cameras.npz") as file:
        nothing = {name: file[name][:0] for name in file}
    np.savez(stages / "cameras.npz", **nothing)
    pd.read_parquet(stages / "renders.parquet").iloc[:0].to_parquet(stages / "renders.parquet")
    views = pack(stages)
    assert views.images.shape == (0, HEIGHT, WIDTH, 3) and views.depth.shape == (0, HEIGHT, WIDTH)
    assert views.world_from_cam.shape == (0, 4, 4) and views.intrinsics.shape == (0, 4)
    assert views.dome_id.shape == (0,) and views.domes_dropped == 0
