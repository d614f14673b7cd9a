import gc
import json
import os
import signal
import time
import weakref
from dataclasses import replace
from filecmp import cmp
from multiprocessing import get_context
from pathlib import Path
from shutil import copytree

import numpy as np
import pandas as pd
import psutil
import pytest
from PIL import Image, ImageOps

from aug3d_core.depth.files import BASELINE_FUSED, FUSED
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster, pixel_rays
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import apply, look_at
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.sfm.files import TRACKS, VIEW_IMAGES, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface import checks, meshes, stage
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.decimate import decimate
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.files import (
    BASELINE_MESH,
    BASELINE_MESH_TEXTURE,
    BASELINE_RENDERS,
    BASELINE_TEXTURED_MESH,
    MESH,
    MESH_SOURCES,
    MESH_TEXTURE,
    TEXTURED_MESH,
)
from aug3d_core.surface.kept import Kept
from aug3d_core.surface.poisson import octree_depth, reconstruct, simplify
from aug3d_core.surface.shape import Shape
from aug3d_core.surface.stage import run

WIDTH, HEIGHT = 7, 11
INTRINSICS = np.array([8.0, 9.0, 3.1, 5.7])
LAKE, LAKE_RADIUS = np.array([-8.0, -6.0]), 6.0


def ground(size: float = 100.0, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles that make a level square about the origin."""
    xy = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]) * size
    return np.column_stack([xy, np.full(4, height)]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def colours(xyz: np.ndarray, size: float = 100.0) -> np.ndarray:
    """Red grows with x, green with y: linear, so that interpolation is exact."""
    return np.column_stack([(xyz[:, :2] / size + 1) * 100, np.full(len(xyz), 50)]).round().astype(np.uint8)


@pytest.mark.parametrize("far", [0.0, 5.0e5])
def test_render_of_the_ground_is_exact(far):
    xyz, triangles = ground()
    mesh = Mesh(xyz, colours(xyz), triangles)
    camera = look_at(np.array([3.0, -20.0, 30.0]), np.array([1.0, 2.0, 0.0]))
    moved = camera.copy()
    moved[:, 3] -= camera[:, :3] @ np.array([far, -far, far])
    shift = np.array([far, -far, far])
    render = Raycaster(xyz + shift, triangles).render(mesh, moved, INTRINSICS, np.array([WIDTH, HEIGHT]))
    assert render.rgb.shape == (HEIGHT, WIDTH, 3)
    # Truth by intersecting each pixel's ray with z = 0
    origin, directions = pixel_rays(camera, INTRINSICS, np.array([WIDTH, HEIGHT]))
    depth = -origin[2] / directions[..., 2]
    truth = origin + depth[..., None] * directions
    assert (render.alpha == 255).all()
    np.testing.assert_allclose(render.depth, depth, rtol=1e-4 if far else 1e-5)
    np.testing.assert_allclose(render.rgb, colours(truth.reshape(-1, 3)).reshape(render.rgb.shape), atol=1)


def test_pixel_rays_go_through_pixel_centres_with_unit_depth():
    camera = look_at(np.array([3.0, -20.0, 30.0]), np.array([1.0, 2.0, 0.0]))
    origin, directions = pixel_rays(camera, INTRINSICS, np.array([WIDTH, HEIGHT]))
    in_cam = apply(camera, (origin + 4.2 * directions).reshape(-1, 3)).reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(in_cam[..., 2], 4.2)
    pixels = in_cam[..., :2] / in_cam[..., 2:] * INTRINSICS[:2] + INTRINSICS[2:]
    np.testing.assert_allclose(pixels[10, 6], [6.5, 10.5])
    np.testing.assert_allclose(pixels[0, 0], [0.5, 0.5])


def test_nothing_is_hit_beside_the_mesh():
    xyz, triangles = ground(1.0)
    camera = look_at(np.array([0.0, 0.0, 50.0]), np.array([0.0, 40.0, 0.0]))
    render = Raycaster(xyz, triangles).render(
        Mesh(xyz, colours(xyz, 1.0), triangles), camera, INTRINSICS, np.array([WIDTH, HEIGHT])
    )
    assert not render.alpha.all()
    assert not render.depth[render.alpha == 0].any()
    assert not render.rgb[render.alpha == 0].any()


def test_a_roof_hides_the_ground_under_it():
    low, triangles = ground(10.0)
    roof, _ = ground(2.0, height=5.0)
    caster = Raycaster(np.concatenate([low, roof]), np.concatenate([triangles, triangles + 4]))
    points = np.array([[0.0, 0.0, 0.1], [9.0, 9.0, 0.1]])
    assert caster.occluded(points, np.array([0.0, 0.0, 50.0]) - points, far=1.0).tolist() == [True, False]
    np.testing.assert_allclose(caster.distance(np.array([[0.0, 0.0, 8.0], [9.0, 9.0, 4.0]])), [3.0, 4.0], rtol=1e-5)
    hits = caster.cast(np.array([[0.0, 0.0, 9.0], [9.0, 9.0, 9.0]]), np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(hits.distance, [4.0, 9.0], rtol=1e-5)


def sphere(count: int = 2000) -> Evidence:
    direction = np.random.default_rng(0).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Evidence(5 * direction + (100, 200, 300), direction, 0.3)


def test_poisson_finds_a_sphere_and_repeats_its_bytes():
    shape = reconstruct(sphere())
    radius = np.linalg.norm(shape.xyz - (100, 200, 300), axis=1)
    np.testing.assert_allclose(radius, 5, atol=0.1)
    again = reconstruct(sphere())
    np.testing.assert_array_equal(shape.xyz, again.xyz)
    np.testing.assert_array_equal(shape.triangles, again.triangles)
    assert len(simplify(shape, 500).triangles) <= 500


def test_the_octree_is_as_deep_as_the_points_are_dense():
    depths = [octree_depth(replace(sphere(), spacing=spacing)) for spacing in (0.9, 0.2, 0.1, 0.05)]
    assert np.diff(depths).tolist() == [0, 1, 1]  # never under 5
    assert octree_depth(replace(sphere(), spacing=1e-9)) == 11


@pytest.mark.parametrize("bound", [0.02, 0.2])
def test_decimation_keeps_its_bound_and_goes_as_far_as_it_may(bound):
    mesh = hills()
    fine = Shape(mesh.xyz.astype(float), mesh.triangles)
    coarse = decimate(fine, bound)
    off = Raycaster(coarse.shape.xyz, coarse.shape.triangles).distance(fine.xyz)
    assert np.percentile(off, 95) <= 1.02 * bound
    assert np.isclose(coarse.error, np.percentile(off, 95), rtol=0.05)
    assert len(coarse.shape.triangles) < len(fine.triangles) / 3
    assert coarse.error > bound / 4


def test_a_flat_sheet_needs_few_triangles():
    mesh = hills(61)
    flat = Shape(mesh.xyz * np.array([1.0, 1.0, 0.0]), mesh.triangles)
    assert len(decimate(flat, 0.01).shape.triangles) <= 500


def hills(count: int = 161, half: float = 40.0) -> Mesh:
    """A hilly square with soft colours of its own."""
    x, y = np.meshgrid(np.linspace(-half, half, count), np.linspace(-half, half, count))
    z = 2 * np.sin(x / 9) * np.cos(y / 7)
    waves = [np.sin(x / 5 + y / 11), np.cos(y / 4 - x / 13), np.sin((x - y) / 6)]
    rgb = np.stack([128 + 90 * wave for wave in waves], -1).round().astype(np.uint8)
    a = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    b, c, d = a + 1, a + count + 1, a + count
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return Mesh(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), rgb.reshape(-1, 3), triangles)


def shared_points(truth: Mesh, views: Views) -> Tracks:
    """Every 50th vertex, wherever it lies in a photo."""
    xyz = truth.xyz[::50].astype(float)
    in_cam = apply(views.cam_from_world, np.broadcast_to(xyz, (len(views), *xyz.shape)))
    xy = in_cam[..., :2] / in_cam[..., 2:] * views.intrinsics[:, None, :2] + views.intrinsics[:, None, 2:]
    view, point = np.nonzero(((xy > 1) & (xy < views.size[:, None] - 1)).all(axis=-1))
    return Tracks(point, view, xy[view, point])


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> dict[str, Path]:
    """The folders of sfm, grouping and depth after a flight over the hills; photo 4 is the target; a lake has no depth."""
    sfm, grouping, depth = (tmp_path_factory.mktemp(name) for name in ("sfm", "grouping", "depth"))
    truth = hills()
    caster = Raycaster(truth.xyz, truth.triangles)
    places = [(x, y) for y in (-15.0, 0.0, 15.0) for x in (-15.0, -5.0, 5.0, 15.0)]
    poses = np.stack([look_at(np.array([x, y, 40.0]), np.array([x, y + 1e-3, 0.0])) for x, y in places])
    n = len(poses)
    views = Views(np.arange(n), poses, np.tile([90.0, 90.0, 50.0, 37.0], (n, 1)), np.tile([101, 75], (n, 1)))
    (sfm / VIEW_IMAGES).mkdir()
    for i in range(n):
        photo = caster.render(truth, poses[i], views.intrinsics[i], views.size[i]).rgb
        Image.fromarray(photo).save(sfm / VIEW_IMAGES / image_name(i))
    views.save(sfm / VIEWS)
    shared_points(truth, views).save(sfm / TRACKS)
    role = np.full(n, "train", object)
    role[[4]], role[[5, 8]] = "target", "support"
    pd.DataFrame({"view": np.arange(n), "photo_id": np.arange(n), "role": role}).to_parquet(grouping / SPLIT_TABLE)
    for name, seed in ((FUSED, 0), (BASELINE_FUSED, 1)):
        points = on_hills(truth, 30_000, np.random.default_rng(seed))
        in_lake = np.linalg.norm(points.xyz[:, :2] - LAKE, axis=1) < LAKE_RADIUS
        Fused(*(getattr(points, f)[~in_lake] for f in ("xyz", "normals", "rgb", "views"))).save(depth / name)
    return {"sfm": sfm, "grouping": grouping, "depth": depth}


def on_hills(truth: Mesh, count: int, rng: np.random.Generator) -> Fused:
    """Points on the hills with a noise of a tenth of a photo's pixel, and one blob above them."""
    triangle = truth.triangles[rng.integers(0, len(truth.triangles), count)]
    a, b, c = (truth.xyz[triangle[:, i]].astype(float) for i in range(3))
    u, v = np.sort(rng.random((2, count, 1)), axis=0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    xyz = u * a + (v - u) * b + (1 - v) * c + rng.normal(0, 0.04, (count, 1)) * normals
    blob = rng.normal((0, 10, 9), 0.2, (60, 3))
    xyz, normals = np.concatenate([xyz, blob]), np.concatenate([normals, np.tile([0, 0, 1.0], (60, 1))])
    n = len(xyz)
    return Fused(
        xyz.astype(np.float32), normals.astype(np.float32), np.zeros((n, 3), np.uint8), np.full(n, 3, np.uint8)
    )


def build_surface(flight: dict[str, Path], out: Path, progress=lambda done, total, what: None, **settings):
    out.mkdir(exist_ok=True)
    config = SurfaceConfig(vertex_budget=20_000, max_gap_spacings=24, **settings)  # the lake is wider than that
    return run(flight, config, out, progress)


@pytest.fixture
def in_turn(monkeypatch):
    """Room for one mesh at a time alone: all of the stage is in this process."""
    monkeypatch.setattr(meshes, "affordable", lambda most: 1)


@pytest.fixture(scope="module")
def built(flight, tmp_path_factory):
    """The stage's outcome and folder."""
    out = tmp_path_factory.mktemp("surface")
    return build_surface(flight, out), out


@pytest.mark.usefixtures("in_turn")
@pytest.mark.parametrize("colour", ["vertex", "texture"])
def test_the_mesh_lies_on_the_hills_and_looks_like_the_photos(flight, built, tmp_path, colour):
    outcome, out = built if colour == "texture" else (build_surface(flight, tmp_path, colour=colour), tmp_path)
    truth = hills()
    caster = Raycaster(truth.xyz, truth.triangles)
    for name in (MESH, BASELINE_MESH):
        xyz = Mesh.load(out / name).xyz.astype(float)
        inner = (np.abs(xyz[:, :2]) < 38).all(axis=1)  # at the rim the surface hangs over
        assert np.percentile(caster.distance(xyz[inner]), 95) < 0.25  # half a pixel of the photos
    assert outcome.metrics["render_psnr"] > 28
    assert outcome.metrics["target_render_psnr"] > 28
    assert outcome.metrics["covered_share"] > 0.9
    assert outcome.metrics["decimation_error_gsd"] <= 0.5
    assert outcome.state == "ok"
    with Image.open(out / BASELINE_RENDERS / image_name(4)) as render:
        assert render.size == (101, 75)
        assert render.mode == "RGBA"
    assert all((out / path).is_file() for path in outcome.pictures.values())
    assert (out / TEXTURED_MESH).exists() == (colour == "texture")


@pytest.mark.usefixtures("in_turn")
def test_no_more_renders_are_held_than_pictures_show(flight, tmp_path, monkeypatch):
    held, most, rgba = list[weakref.ref](), 0, checks.rgba

    def counted(render):
        nonlocal most
        gc.collect()  # the checks of shapes in tests leave circles
        held.append(weakref.ref(image := rgba(render)))
        most = max(most, sum(one() is not None for one in held))
        return image

    monkeypatch.setattr(checks, "rgba", counted)
    monkeypatch.setattr(stage, "PICTURE_ROWS", 1)
    build_surface(flight, tmp_path, colour="vertex", check_views=8)
    assert len(held) == 9
    assert most <= 5, "one of each kind that is shown, and what is at hand"


def test_the_lake_is_a_hole_and_the_blob_is_gone(built):
    for name in (MESH, BASELINE_MESH):
        mesh = Mesh.load(built[1] / name)
        caster = Raycaster(mesh.xyz, mesh.triangles)
        to_lake = np.linalg.norm(mesh.xyz[:, :2] - LAKE, axis=1)
        assert to_lake.min() > LAKE_RADIUS - 1.5
        down = caster.cast(np.array([[*LAKE, 30.0], [0.0, 10.0, 30.0]]), np.array([0, 0, -1.0]))
        assert down.triangle[0] == -1
        assert down.distance[1] > 25  # the ground, not what floats 9 above it


def test_textured_and_plain_mesh_have_the_same_shape(built):
    plain = Mesh.load(built[1] / BASELINE_MESH)
    textured = TexturedMesh.load(built[1] / BASELINE_TEXTURED_MESH, built[1] / BASELINE_MESH_TEXTURE)
    np.testing.assert_array_equal(plain.xyz, textured.xyz)
    np.testing.assert_array_equal(plain.triangles, textured.triangles)
    assert textured.uv.min() >= 0
    assert textured.uv.max() <= 1


def test_the_sources_are_named(built):
    sources = json.loads((built[1] / MESH_SOURCES).read_text())
    assert sources == {"mesh": [0, 1, 2, 3, 6, 7, 9, 10, 11], "baseline": [i for i in range(12) if i != 4]}


class Stopped(BaseException):
    """As if the process were killed."""


@pytest.mark.usefixtures("in_turn")
def test_stopped_after_each_piece_it_makes_none_twice_and_ends_in_the_same_bytes(flight, built, tmp_path, monkeypatch):
    keep, made, told = Kept.piece, list[str](), list[tuple[int, int]]()

    def piece(self, name, kind, make):
        there = self.has(name)
        found = keep(self, name, kind, make)
        if not there:
            made.append(f"{self.folder.name}/{name}")
            raise Stopped
        return found

    def stage():
        told.clear()
        build_surface(flight, tmp_path, lambda done, total, _: told.append((done, total)))

    monkeypatch.setattr(Kept, "piece", piece)
    for _ in range(6):
        with pytest.raises(Stopped):
            stage()
    stage()
    assert made == [
        f"{mesh}/{name}" for mesh in ("train", "given") for name in ("tile_00000", "vertices", "texels_000")
    ]
    assert told == [*sorted(told[:-1]), (1, 1)] and told[-2][0] == told[-2][1] - 1, "all that is kept counts as done"
    files = sorted(p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(built[1]) for p in built[1].rglob("*") if p.is_file())
    assert len(files) >= 10
    assert all(cmp(tmp_path / f, built[1] / f, shallow=False) for f in files)


@pytest.mark.usefixtures("in_turn")
def test_no_pixel_of_a_held_out_photo_reaches_the_meshes(flight, built, tmp_path):
    train = [MESH, TEXTURED_MESH, MESH_TEXTURE]
    baseline = [BASELINE_MESH, BASELINE_TEXTURED_MESH, BASELINE_MESH_TEXTURE]
    for hidden, same in (((4,), train + baseline), ((4, 5, 8), train)):
        sfm = tmp_path / f"sfm{len(hidden)}"
        (sfm / VIEW_IMAGES).mkdir(parents=True)
        for name in (VIEWS, TRACKS):
            (sfm / name).write_bytes((flight["sfm"] / name).read_bytes())
        for photo in (flight["sfm"] / VIEW_IMAGES).iterdir():
            with Image.open(photo) as image:
                black = photo.name in {image_name(i) for i in hidden}
                (Image.new("RGB", image.size) if black else image).save(sfm / VIEW_IMAGES / photo.name)
        out = tmp_path / f"out{len(hidden)}"
        build_surface(flight | {"sfm": sfm}, out)
        assert all(cmp(out / name, built[1] / name, shallow=False) for name in same)
    assert (out / BASELINE_MESH_TEXTURE).read_bytes() != (built[1] / BASELINE_MESH_TEXTURE).read_bytes()


@pytest.mark.usefixtures("in_turn")
def test_a_mesh_that_shows_held_out_photos_worse_than_one_colour_is_degraded(flight, built, tmp_path):
    assert built[0].metrics["target_render_psnr"] > built[0].metrics["target_flat_psnr"]
    sfm = tmp_path / "sfm"
    copytree(flight["sfm"], sfm)
    target = sfm / VIEW_IMAGES / image_name(4)
    with Image.open(target) as image:
        other = ImageOps.invert(image.convert("RGB"))
    other.save(target)
    outcome = build_surface(flight | {"sfm": sfm}, tmp_path / "out")
    assert outcome.state == "degraded"
    assert "held-out photos no better than one colour" in outcome.notes[0]


@pytest.mark.parametrize("poor", [FUSED, BASELINE_FUSED])
@pytest.mark.parametrize("room", [1, 2])
def test_too_few_fused_points_are_an_error_that_says_so(flight, tmp_path, monkeypatch, poor, room):
    monkeypatch.setattr(meshes, "affordable", lambda most: room)
    copytree(flight["depth"], tmp_path / "depth")
    fused = Fused.load(flight["depth"] / poor)
    Fused(*(getattr(fused, f)[:50] for f in ("xyz", "normals", "rgb", "views"))).save(tmp_path / "depth" / poor)
    with pytest.raises(InputError, match="of 50 fused points"):
        build_surface(flight | {"depth": tmp_path / "depth"}, tmp_path / "out", colour="vertex")


def killed(*_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_mesh_whose_process_is_killed_is_an_error_that_is_tried_again(flight, tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "affordable", lambda most: 2)
    monkeypatch.setattr(meshes, "_made_beside", killed)
    with pytest.raises(WorkerDied, match="was killed") as died:
        build_surface(flight, tmp_path, colour="vertex")
    assert died.value.cause == "killed"
    monkeypatch.undo()
    build_surface(flight, tmp_path, colour="vertex")
    assert (tmp_path / MESH).exists()


def sleeping(*_):
    time.sleep(120)


def side_by_side_with_one_that_sleeps(flight: dict[str, Path], out: Path) -> None:
    meshes.affordable = lambda most: 2
    meshes._made_beside = sleeping
    build_surface(flight, out, colour="vertex")


def test_a_stage_that_is_killed_leaves_no_process_at_its_work(flight, tmp_path):
    stage = get_context("spawn").Process(target=side_by_side_with_one_that_sleeps, args=(flight, tmp_path))
    stage.start()
    leader, beside, until = psutil.Process(stage.pid), list[psutil.Process](), time.monotonic() + 120
    while not beside and time.monotonic() < until:
        beside = [one for one in leader.children() if "resource_tracker" not in " ".join(one.cmdline())]
        time.sleep(0.05)
    assert beside
    time.sleep(5)  # it has begun
    stage.kill()
    stage.join()
    assert psutil.wait_procs(beside, timeout=60)[1] == []


def test_side_by_side_the_progress_is_that_of_the_larger_mesh_and_only_grows(flight, tmp_path, monkeypatch):
    asked, told = list[int](), list[tuple[int, int]]()
    monkeypatch.setattr(meshes, "affordable", lambda most: asked.append(most) or 2)
    build_surface(flight, tmp_path, lambda done, total, _: told.append((done, total)), colour="vertex")
    assert asked == [max(len(Fused.load(flight["depth"] / name).xyz) for name in (FUSED, BASELINE_FUSED))]
    assert told == [*sorted(told[:-1]), (1, 1)]
    assert {total for _, total in told[:-1]} == {2 * 11 + 1}


@pytest.mark.usefixtures("in_turn")
def test_a_texel_budget_makes_texels_larger(flight, tmp_path):
    outcome = build_surface(flight, tmp_path, texel_budget=2**14)
    assert outcome.metrics["texels"] <= 2**14
    assert outcome.metrics["colour_detail_gsd"] > 1
    assert "budget" in outcome.metrics["needs"]
