"""The worker with real Cycles: where things are in the picture, how far, in what colour."""

from pathlib import Path

import numpy as np
import psutil
import pytest

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import apply, homogeneous, invert, look_at, project
from aug3d_core.rendering import launch
from aug3d_core.rendering.colour import linear_from_srgb
from aug3d_core.rendering.job import MeshFile, RenderJob, Shard, Sunlit
from aug3d_core.rendering.launch import drop_leftovers, render
from aug3d_core.run.helper_process import WorkerDied

WIDTH, HEIGHT = 7, 11  # odd and unequal, so that no swap of axes goes unseen
COLOURS = np.array([[255, 0, 0], [12, 200, 77], [128, 128, 128], [3, 9, 250]], np.uint8)


def quad(corners, colour) -> Mesh:
    rgb = np.tile(np.asarray(colour, np.uint8), (4, 1))
    return Mesh(np.asarray(corners, np.float32), rgb, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def cameras(count: int, target, distance: float, rng: np.random.Generator):
    """Draw cameras about a target, rolled, with unequal focal lengths and the principal point off the centre."""
    poses, lenses = [], []
    for _ in range(count):
        direction = rng.normal(size=3)
        direction[2] = abs(direction[2]) + 0.4
        centre = target + distance * direction / np.linalg.norm(direction)
        roll = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
        poses.append(turn @ look_at(centre, target))
        lenses.append(
            [
                rng.uniform(5, 16),
                rng.uniform(5, 16),
                WIDTH / 2 + rng.uniform(-1.5, 1.5),
                HEIGHT / 2 + rng.uniform(-2.5, 2.5),
            ]
        )
    return np.stack(poses), np.array(lenses)


def shoot(
    folder: Path, mesh: Mesh | TexturedMesh, cam_from_world, intrinsics, samples: int = 256
) -> dict[str, np.ndarray]:
    count = len(cam_from_world)
    if isinstance(mesh, TexturedMesh):
        file = MeshFile(path=folder / "mesh.npz", texture=folder / "mesh.png")
        mesh.save(folder / "mesh.npz", folder / "mesh.png")
    else:
        file = MeshFile(path=folder / "mesh.ply")
        mesh.save(file.path)
    np.savez(
        folder / "cameras.npz",
        view_id=np.arange(count),
        world_from_cam=homogeneous(invert(cam_from_world)),
        intrinsics=intrinsics,
        size=np.tile([WIDTH, HEIGHT], (count, 1)),
    )
    shard = Shard(first=0, last=count, out=folder / "0000.npz", samples=samples)
    told = []
    render(RenderJob(meshes=(file,), cameras=folder / "cameras.npz", shards=(shard,)), told.append)
    assert told == list(range(1, count + 1))
    with np.load(shard.out) as arrays:
        return dict(arrays)


def covered(corners) -> np.ndarray:
    """Return which share of each pixel a convex polygon covers, by counting 40 x 40 points of it."""
    x, y = np.meshgrid((np.arange(WIDTH * 40) + 0.5) / 40, (np.arange(HEIGHT * 40) + 0.5) / 40)
    (ax, ay), (bx, by) = corners.T[:, :, None, None], np.roll(corners, -1, axis=0).T[:, :, None, None]
    side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    inside = (side > 0).all(axis=0) | (side < 0).all(axis=0)
    return inside.reshape(HEIGHT, 40, WIDTH, 40).mean(axis=(1, 3))


def shift_px(image, corners) -> np.ndarray:
    """Return how far the polygon would have to be moved to explain the image best (one Gauss-Newton step)."""
    step = 0.1
    slopes = [(covered(corners + d) - covered(corners - d)).ravel() / (2 * step) for d in step * np.eye(2)]
    return np.linalg.lstsq(np.stack(slopes, axis=1), (image - covered(corners)).ravel(), rcond=None)[0]


def test_things_appear_where_the_pinhole_model_says(tmp_path):
    rng = np.random.default_rng(1)
    at = np.array([3.0, -2.0, 1.0])
    poses, lenses = cameras(24, at, 20.0, rng)
    mesh = quad(at + 2.5 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), (200, 90, 10))
    alpha = shoot(tmp_path, mesh, poses, lenses)["alpha"] / 255.0
    for image, pose, lens in zip(alpha, poses, lenses, strict=True):
        corners = project(apply(pose, mesh.xyz.astype(float)), lens)
        np.testing.assert_allclose(image, covered(corners), atol=0.06)
        np.testing.assert_allclose(shift_px(image, corners), 0, atol=0.05)


def test_depth_is_along_z_at_pixel_centres_and_colour_in_is_colour_out(tmp_path):
    rng = np.random.default_rng(2)
    poses, lenses = cameras(len(COLOURS), np.zeros(3), 30.0, rng)
    ground = np.array([(-900, -900, 0), (900, -900, 0), (900, 900, 0), (-900, 900, 0)], float)
    shard = shoot(tmp_path, quad(ground, COLOURS[1]), poses, lenses, samples=4)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    for depth, rgb, pose, lens in zip(shard["depth"], shard["rgb"], poses, lenses, strict=True):
        rays = np.stack([(x - lens[2]) / lens[0], (y - lens[3]) / lens[1], np.ones_like(x)], axis=-1)
        down = rays @ pose[:, :3][:, 2]  # how much a ray descends per metre along z
        centre_height = invert(pose)[2, 3]
        expected = np.where(down < -0.05, -centre_height / np.minimum(down, -0.05), 0)
        sure = expected > 0
        np.testing.assert_allclose(
            depth[sure], expected[sure], rtol=2e-3
        )  # float16, and rays within 0.001 px of centres
        assert (rgb[sure] == COLOURS[1]).all()
        assert sure.any()
    assert shard["alpha"].dtype == np.uint8 and shard["depth"].dtype == np.float16


def test_a_texture_is_shown_right_side_up_in_its_own_colours(tmp_path):
    """Each block of a picture laid on the ground comes out as one pixel of a camera straight above it."""
    blocks = np.random.default_rng(5).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    picture = np.kron(blocks, np.ones((32, 32, 1), np.uint8))  # between texels Cycles blends
    half = np.array([WIDTH, HEIGHT]) / 2
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = ((corners + 1) / 2)[triangles]
    mesh = TexturedMesh(np.column_stack([corners * half, np.zeros(4)]), triangles, uv, picture)
    pose = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]
    shard = shoot(tmp_path, mesh, pose, np.array([[10.0, 10.0, *half]]), samples=256)
    assert (shard["alpha"] == 255).all()
    off = np.abs(linear_from_srgb(shard["rgb"][0]) - linear_from_srgb(blocks))
    assert off.max() < 0.05
    assert np.median(off) < 0.01


def test_edges_keep_their_colour_and_nothing_has_no_depth(tmp_path):
    pose = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]
    lens = np.array([[10.0, 10.0, WIDTH / 2, HEIGHT / 2]])
    mesh = quad([(-1.25, -2.1, 0), (1.25, -2.1, 0), (1.25, 2.1, 0), (-1.25, 2.1, 0)], COLOURS[3])
    shard = shoot(tmp_path, mesh, pose, lens, samples=1024)
    alpha, rgb, depth = shard["alpha"][0], shard["rgb"][0], shard["depth"][0]
    across, down = np.zeros(WIDTH), np.zeros(HEIGHT)
    across[2:5], down[3:8] = (0.75, 1, 0.75), (0.6, 1, 1, 1, 0.6)  # the quad is 2.5 by 4.2 pixels
    np.testing.assert_allclose(alpha / 255, np.outer(down, across), atol=0.02)
    assert (rgb[alpha > 0] == COLOURS[3]).all()
    np.testing.assert_array_equal(depth > 0, np.outer(down, across) > 0)
    np.testing.assert_allclose(depth[depth > 0], 10.0, rtol=1e-3)


def test_depth_is_what_lies_at_the_pixel_s_centre_whatever_the_seed_and_the_samples(tmp_path):
    """A plate over the ground covers 0.7, 1 and 0.3 of three columns of pixels: the first two have their centres on it."""
    plate = np.array([(-0.6, -9, 5), (0.4, -9, 5), (0.4, 9, 5), (-0.6, 9, 5)])
    ground = np.array([(-19, -19, 0), (19, -19, 0), (19, 19, 0), (-19, 19, 0)])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    Mesh(np.concatenate([plate, ground]).astype(np.float32), np.full((8, 3), 128, np.uint8), triangles).save(
        tmp_path / "mesh.ply"
    )
    pose, lens = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3)), np.array([10.0, 10.0, WIDTH / 2, HEIGHT / 2])
    np.savez(
        tmp_path / "cameras.npz",
        view_id=[0],
        world_from_cam=homogeneous(invert(pose[None])),
        intrinsics=lens[None],
        size=[[WIDTH, HEIGHT]],
    )
    shards = tuple(
        Shard(first=0, last=1, out=tmp_path / f"{samples}_{seed}.npz", samples=samples, seed=seed)
        for samples in (1, 3, 16)
        for seed in (0, 1, 7)
    )
    mesh = MeshFile(path=tmp_path / "mesh.ply")
    render(RenderJob(meshes=(mesh,), cameras=tmp_path / "cameras.npz", shards=shards), lambda _: None)
    x = project(apply(pose, plate), lens)[:, 0]
    centre = np.arange(WIDTH) + 0.5
    on_plate = (x.min() < centre) & (centre < x.max())
    assert on_plate.sum() == 2
    for shard in shards:
        with np.load(shard.out) as arrays:
            expected = np.tile(np.where(on_plate, 5.0, 10.0), (HEIGHT, 1))
            np.testing.assert_allclose(arrays["depth"][0], expected, rtol=1e-3, err_msg=shard.out.stem)


def test_the_same_job_gives_the_same_bytes(tmp_path):
    rng = np.random.default_rng(3)
    poses, lenses = cameras(2, np.zeros(3), 5.0, rng)
    mesh = quad([(-2, -1, 0), (1, -1, 0), (1, 1, 1), (-2, 1, 0)], COLOURS[2])
    shoot(tmp_path, mesh, poses, lenses, samples=7)
    first = (tmp_path / "0000.npz").read_bytes()
    (tmp_path / "0000.npz").unlink()
    shoot(tmp_path, mesh, poses, lenses, samples=7)
    assert (tmp_path / "0000.npz").read_bytes() == first


def test_a_missing_mesh_is_named(tmp_path):
    missing, out = MeshFile(path=tmp_path / "missing.ply"), tmp_path / "0.npz"
    with pytest.raises(WorkerDied, match=r"(?s)exit code 1.*missing\.ply"):
        render(
            RenderJob(
                meshes=(missing,),
                cameras=tmp_path / "c.npz",
                shards=(Shard(first=0, last=1, out=out, samples=1),),
            ),
            lambda _: None,
        )
    assert not out.exists()


def test_a_worker_that_grew_leaves_the_rest_to_another_and_no_view_differs(tmp_path, monkeypatch):
    """Shards of two views, in one process or in one each, on one thread or two, hold what one shard of all views holds."""
    rng = np.random.default_rng(6)
    poses, lenses = cameras(4, np.zeros(3), 5.0, rng)
    whole = shoot(tmp_path, quad([(-2, -1, 0), (1, -1, 0), (1, 1, 1), (-2, 1, 0)], COLOURS[2]), poses, lenses, 5)
    parts = tuple(Shard(first=i, last=i + 2, out=tmp_path / f"part{i}.npz", samples=5) for i in (0, 2))
    job = RenderJob(meshes=(MeshFile(path=tmp_path / "mesh.ply"),), cameras=tmp_path / "cameras.npz", shards=parts)
    started, run_worker = [], launch.run_worker
    monkeypatch.setattr(launch, "run_worker", lambda *given: (started.append(given), run_worker(*given)))
    for changes, processes in (({"growth_mib": 0.0}, 2), ({"threads": 1}, 1)):
        started.clear()
        spent = render(job.model_copy(update=changes), lambda _: None)
        assert (len(started), spent.views) == (processes, 4)
        for part in parts:
            with np.load(part.out) as arrays:
                for name, array in whole.items():
                    np.testing.assert_array_equal(arrays[name], array[part.first : part.last])
            part.out.unlink()
        assert 0 <= spent.cycles_s < spent.worker_s


def test_a_worker_killed_in_its_second_shard_leaves_the_first_and_the_next_run_ends_in_the_same_bytes(tmp_path):
    rng = np.random.default_rng(7)
    poses, lenses = cameras(4, np.zeros(3), 5.0, rng)
    samples = 32768  # a view takes long enough for the kill to reach it
    whole = shoot(tmp_path, quad([(-2, -1, 0), (1, -1, 0), (1, 1, 1), (-2, 1, 0)], COLOURS[2]), poses, lenses, samples)
    shards = tmp_path / "shards"
    shards.mkdir()
    parts = tuple(Shard(first=i, last=i + 2, out=shards / f"part{i}.npz", samples=samples) for i in (0, 2))
    job = RenderJob(meshes=(MeshFile(path=tmp_path / "mesh.ply"),), cameras=tmp_path / "cameras.npz", shards=parts)

    def kill(done: int) -> None:
        if done == 3:
            for child in psutil.Process().children():
                if "aug3d_core.rendering.worker" in child.cmdline():
                    child.kill()

    with pytest.raises(WorkerDied, match="SIGKILL"):
        render(job, kill)
    assert [part.out.exists() for part in parts] == [True, False]
    assert [*shards.glob("*/*.exr")], "on the disk of the shards"
    kept = parts[0].out.read_bytes()
    drop_leftovers(parts)
    assert [*shards.iterdir()] == [parts[0].out]
    assert render(job, lambda _: None).views == 2
    assert {*shards.iterdir()} == {part.out for part in parts}
    assert parts[0].out.read_bytes() == kept
    for part in parts:
        with np.load(part.out) as arrays:
            for name, array in whole.items():
                np.testing.assert_array_equal(arrays[name], array[part.first : part.last])


def test_the_texture_is_lit_by_the_sun_from_where_it_stands(tmp_path):
    """A slope that faces the sun is brighter than one that does not, and under emission both are what was photographed."""
    ridge = [(-3, -3, 0), (0, -3, 2), (0, 3, 2), (-3, 3, 0), (3, -3, 0), (3, 3, 0)]
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]], np.int32)
    mesh = Mesh(np.array(ridge, np.float32), np.tile(COLOURS[2], (6, 1)), triangles)
    pose = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]
    emitted = shoot(tmp_path, mesh, pose, np.array([[14.0, 14.0, WIDTH / 2, HEIGHT / 2]]), samples=16)["rgb"][0]
    assert (emitted[HEIGHT // 2] == COLOURS[2]).all()
    for azimuth, east_is_brighter in ((90.0, True), (270.0, False)):
        out = tmp_path / f"{azimuth}.npz"
        job = RenderJob(
            meshes=(MeshFile(path=tmp_path / "mesh.ply"),),
            cameras=tmp_path / "cameras.npz",
            shards=(Shard(first=0, last=1, out=out, samples=16),),
            light=Sunlit(sun_azimuth_deg=azimuth, sun_elevation_deg=40),
        )
        render(job, lambda _: None)
        with np.load(out) as arrays:
            row = arrays["rgb"][0, HEIGHT // 2].mean(axis=1)
        west, east = row[: WIDTH // 2].mean(), row[-(WIDTH // 2) :].mean()
        assert (east > west + 20) == east_is_brighter and (west > east + 20) != east_is_brighter


def test_level_ground_in_the_open_keeps_its_brightness_under_the_sun(tmp_path):
    ground = quad([(-900, -900, 0), (900, -900, 0), (900, 900, 0), (-900, 900, 0)], (100, 100, 100))
    pose = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]
    shoot(tmp_path, ground, pose, np.array([[14.0, 14.0, WIDTH / 2, HEIGHT / 2]]), samples=1)
    shard = Shard(first=0, last=1, out=tmp_path / "sun.npz", samples=16)
    light = Sunlit(sun_azimuth_deg=200, sun_elevation_deg=35).exposed()
    files = {"meshes": (MeshFile(path=tmp_path / "mesh.ply"),), "cameras": tmp_path / "cameras.npz"}
    render(RenderJob(shards=(shard,), light=light, **files), lambda _: None)
    with np.load(shard.out) as arrays:
        luminance = linear_from_srgb(arrays["rgb"][0]) @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(luminance, linear_from_srgb(np.array([100], np.uint8))[0], rtol=0.05)
