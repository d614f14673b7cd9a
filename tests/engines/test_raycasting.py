"""Ray casting against Cycles on a picture laid on the ground, and the benchmark around both."""

import numpy as np
import pytest

from aug3d_core.bench import rendering
from aug3d_core.bench.raycasting import cast_view, raycast_figures
from aug3d_core.domes.files import CAMERAS
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear
from aug3d_core.rendering.files import SHARDS
from aug3d_core.run.stage import Outcome
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Trial
from aug3d_core.surface.files import MESH_TEXTURE, TEXTURED_MESH

SIZE = (7, 11)


@pytest.fixture
def mesh() -> TexturedMesh:
    """A ground of 7 x 11, one texel to the unit, each block of 3 x 3 texels to be one pixel."""
    texels = np.random.default_rng(0).integers(0, 256, (3 * SIZE[1], 3 * SIZE[0], 3)).astype(np.uint8)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    xyz = np.column_stack([corners * np.array(SIZE) / 2, np.zeros(4)])
    return TexturedMesh(xyz, triangles, ((corners + 1) / 2)[triangles], texels)


@pytest.fixture
def camera() -> dict[str, np.ndarray]:
    pose = homogeneous(invert(look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]))[0]
    return {"world_from_cam": pose, "intrinsics": np.array([10.0, 10.0, 3.5, 5.5]), "size": np.array(SIZE)}


def test_nine_rays_average_light_over_the_pixel(mesh, camera):
    cast = cast_view(Raycaster(mesh.xyz, mesh.triangles), mesh, camera, 3)
    light = linear_from_srgb(mesh.texture).reshape(SIZE[1], 3, SIZE[0], 3, 3).mean(axis=(1, 3))
    assert np.abs(cast.rgb.astype(int) - srgb_from_linear(light)).max() <= 1
    assert (cast.covered == 1).all()


def test_one_ray_is_the_pixel_s_centre(mesh, camera):
    cast = cast_view(Raycaster(mesh.xyz, mesh.triangles), mesh, camera, 1)
    assert np.abs(cast.rgb.astype(int) - mesh.texture[1::3, 1::3]).max() <= 1


def test_psnr_is_of_what_both_show(mesh, camera, tmp_path):
    mesh.save(tmp_path / TEXTURED_MESH, tmp_path / MESH_TEXTURE)
    rgb = cast_view(Raycaster(mesh.xyz, mesh.triangles), mesh, camera, 3).rgb[None].astype(int)
    alpha = np.full(rgb.shape[:3], 255, np.uint8)
    rgb[:, 3:] = np.where(rgb[:, 3:] < 128, rgb[:, 3:] + 5, rgb[:, 3:] - 5)
    rgb[:, :3], alpha[:, :3] = 0, 0  # empty to Cycles
    (tmp_path / SHARDS).mkdir()
    np.savez(tmp_path / SHARDS / "0000.npz", rgb=rgb.astype(np.uint8), alpha=alpha)
    cameras = {name: array[None] for name, array in camera.items()}
    found = raycast_figures(tmp_path, cameras, tmp_path / SHARDS, lambda *_: None)
    assert found["rendering_raycast_nine_rays_psnr_db"].value == pytest.approx(20 * np.log10(255 / 5), abs=1e-6)
    assert found["rendering_raycast_psnr_db"].value < 25
    assert found["raycast_views_per_minute"].value > 0


def test_the_stage_s_own_figures_are_told_with_their_goals(camera, tmp_path, monkeypatch):
    metrics = {"overhead_share": 0.2, "worker_growth_mib": 12.0, "samples": 8, "samples_psnr_db": 38.5}
    monkeypatch.setattr(rendering, "run", lambda *_: Outcome(metrics=metrics))
    cameras = {"view_id": np.arange(1)} | {name: array[None] for name, array in camera.items()}
    found, samples = rendering.cycles_figures(tmp_path, cameras, tmp_path, lambda *_: None)
    assert samples == 8 and (tmp_path / CAMERAS).exists()
    assert (found["render_overhead_share"].value, found["render_overhead_share"].holds) == (0.2, False)
    assert (found["worker_growth_mib"].goal, found["worker_growth_mib"].holds) == (300.0, True)
    assert found["render_views_per_minute"].goal == 200.0 and found["render_samples_psnr_db"].holds


def test_a_town_that_failed_is_a_figure_without_a_value(tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "run_trial", lambda *_: Trial({}, "the mesh is empty"))
    found = rendering.figures(Store(tmp_path), Measured("tiny"), lambda *_: None)
    assert found["render_views_per_minute"].value is None
    assert found["render_views_per_minute"].failure == "the mesh is empty"
