"""The town stage with real Cycles, on a very small town."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.geometry.views import Views
from aug3d_core.photos.exif import read_exif
from aug3d_core.rendering.job import MeshFile, RenderJob, Shard
from aug3d_core.rendering.launch import render
from aug3d_core.town.config import TownConfig
from aug3d_core.town.declared import TOWN
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_FOOTPRINTS, TRUTH_LENS, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.stage import assist, photo_name, run

CONFIG = TownConfig(length_m=70, width_m=70, altitude_m=45, width_px=320, samples=2, photos_per_shard=4)
PHOTOS = 8


@pytest.fixture(scope="module")
def town(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("town")
    outcome = run({}, CONFIG, out, lambda *_: None)
    assert outcome.metrics["photos"] == PHOTOS and outcome.metrics["buildings"] > 5
    assert (out / next(iter(outcome.pictures.values()))).exists()
    return out


def photo(town: Path, photo_id: int) -> np.ndarray:
    with Image.open(town / TOWN_PHOTOS / photo_name(photo_id)) as image:
        return np.asarray(image.convert("L"), float)


def test_photographs_and_truth_are_apart_and_complete(town):
    names = sorted(p.name for p in (town / TOWN_PHOTOS).iterdir())
    assert names == [photo_name(i) for i in range(PHOTOS)]
    views = Views.load(town / TRUTH_POSES)
    assert len(views) == PHOTOS and (views.size == [320, 240]).all()
    footprints = json.loads((town / TRUTH_FOOTPRINTS).read_text())
    assert footprints["footprints"] and set(footprints["origin"]) == {"lat_deg", "lon_deg", "alt_m"}
    times = []
    for name in names:
        with Image.open(town / TOWN_PHOTOS / name) as image:
            exif = read_exif(image, image.size)
        assert exif.focal_px == pytest.approx(CONFIG.focal_px, rel=1e-3)
        times.append(exif.time)
    assert times == sorted(set(times))


def test_photographs_are_well_exposed_and_full_of_detail(town):
    for i in range(PHOTOS):
        image = photo(town, i)
        assert 60 < image.mean() < 170 and image.std() > 25
        assert (image > 250).mean() < 0.02 and (image < 5).mean() < 0.05
        assert np.abs(np.diff(image, axis=1)).mean() > 6


def test_a_killed_run_continues_and_ends_in_the_same_bytes(town):
    files = {p: p.read_bytes() for p in (town / TOWN_PHOTOS).iterdir()}
    truth = (town / TRUTH_MESH).read_bytes()
    lost = [town / TOWN_PHOTOS / photo_name(i) for i in (5, 6)]
    for path in lost:
        path.unlink()
    told = []
    run({}, CONFIG, town, lambda *p: told.append(p))
    assert [done for done, _, what in told if what == "photographs"] == [5, 6, 7, 8], (
        "only the second shard is rendered"
    )
    assert {p: p.read_bytes() for p in (town / TOWN_PHOTOS).iterdir()} == files
    assert (town / TRUTH_MESH).read_bytes() == truth


def test_a_machine_that_helps_takes_the_same_photographs(town, tmp_path):
    (tmp_path / TOWN_PHOTOS).mkdir()
    for i in range(CONFIG.photos_per_shard):
        (tmp_path / TOWN_PHOTOS / photo_name(i)).write_bytes(b"there already")
    assert assist({}, CONFIG, tmp_path, lambda *_: None).metrics["photos"] == PHOTOS - CONFIG.photos_per_shard
    for i in range(PHOTOS):
        there, theirs = (folder / TOWN_PHOTOS / photo_name(i) for folder in (town, tmp_path))
        assert theirs.read_bytes() == (b"there already" if i < CONFIG.photos_per_shard else there.read_bytes())


def test_what_another_machine_goes_on_with_is_every_photograph(town):
    handed_over = {path for pattern in TOWN.shards for path in town.glob(pattern)}
    assert handed_over == set((town / TOWN_PHOTOS).iterdir())


def test_the_true_mesh_seen_from_the_true_pose_lies_on_the_photograph(town, tmp_path):
    views = Views.load(town / TRUTH_POSES)
    np.savez(
        tmp_path / "cameras.npz",
        view_id=views.photo_id,
        world_from_cam=homogeneous(invert(views.cam_from_world)),
        intrinsics=views.intrinsics,
        size=views.size,
    )
    job = RenderJob(
        meshes=(MeshFile(path=town / TRUTH_MESH),),
        cameras=tmp_path / "cameras.npz",
        shards=(Shard(first=2, last=3, out=tmp_path / "0.npz", samples=4),),
    )
    render(job, lambda _: None)
    with np.load(job.shards[0].out) as shard:
        seen, alpha = shard["rgb"][0].mean(axis=2), shard["alpha"][0]
    assert (alpha == 255).all(), "photographs show nothing beyond the world's edge"
    assert len(Mesh.load(town / TRUTH_MESH).xyz) > 10_000
    image, shifts = photo(town, 2), range(-6, 7)
    middle = seen[10:-10, 10:-10].ravel()
    fit = [
        [np.corrcoef(np.roll(image, (dy, dx), (0, 1))[10:-10, 10:-10].ravel(), middle)[0, 1] for dx in shifts]
        for dy in shifts
    ]
    best = np.unravel_index(np.argmax(fit), (13, 13))
    assert np.abs(np.array(best) - 6).max() <= 1


def test_a_lens_bends_the_photograph_as_the_truth_says(tmp_path):
    """The straight and the bent photograph of one pose agree where the written formula says, at the rim too."""
    config = CONFIG.model_copy(update={"max_photos": 1, "noise_levels": 0.0, "samples": 8})
    images = {}
    for name, k1 in (("straight", 0.0), ("bent", -0.12)):
        out = tmp_path / name
        out.mkdir()
        run({}, config.model_copy(update={"radial_k1": k1}), out, lambda *_: None)
        images[name] = photo(out, 0)
    lens = json.loads((tmp_path / "bent" / TRUTH_LENS).read_text())
    assert lens["model"] == "RADIAL" and (lens["width"], lens["height"]) == (320, 240)
    focal, cx, cy, k1, k2 = lens["params"]
    assert k1 == -0.12 and focal == pytest.approx(CONFIG.focal_px)
    # Barrel distortion: the bent picture shows all that the straight one does, so each straight pixel can be looked up.
    x, y = np.meshgrid((np.arange(320) + 0.5 - cx) / focal, (np.arange(240) + 0.5 - cy) / focal)
    grow = 1 + k1 * (x**2 + y**2) + k2 * (x**2 + y**2) ** 2
    at = [focal * y * grow + cy - 0.5, focal * x * grow + cx - 0.5]
    straightened, offset = map_coordinates(images["bent"], at, order=1), 0.12 * 0.8**2 * 200
    assert offset > 10, "at the corner the lens moves the picture by more than ten pixels"
    fine = gaussian_filter(images["straight"], 1), gaussian_filter(straightened, 1)
    for rows in (slice(5, 60), slice(90, 150), slice(180, 235)):
        for columns in (slice(5, 70), slice(130, 190), slice(250, 315)):
            a, b = fine[0][rows, columns].ravel(), fine[1][rows, columns].ravel()
            assert np.corrcoef(a, b)[0, 1] > 0.97


def test_every_fault_at_once_still_makes_a_flight(tmp_path):
    config = CONFIG.model_copy(
        update={
            "path": "oblique", "terrain": "terraces", "lake": True, "bare_roofs": True, "buildings": "identical",
            "blur_px": 2.0, "blur_share": 0.5, "exposure_factor": 1.6, "radial_k1": 0.05, "noise_levels": 4.0,
            "gps": False, "exif_focal_factor": 0.0, "max_photos": 4, "width_px": 160,
        }
    )  # fmt: skip
    outcome = run({}, config, tmp_path, lambda *_: None)
    assert outcome.metrics["photos"] == 4
    with Image.open(tmp_path / TOWN_PHOTOS / photo_name(3)) as image:
        exif = read_exif(image, image.size)
        assert image.size == (160, 120)
    assert np.isnan(exif.focal_px) and np.isnan(exif.lat_deg) and exif.time is not None
