"""Given poses through the real engines: each format on photographs whose truth is known, and each that lies is refused."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from aug3d_core.export.folder_formats import export
from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import apply, centres, homogeneous, project
from aug3d_core.geometry.views import Points, Tracks, Views
from tests.engines.little_scene import FOCAL_PX, SIZE, poses, write_flight
from tests.engines.sfm_runs import run_stage, take_photos
from tests.same_files import assert_same_files

pytestmark = pytest.mark.slow

CAMERA = {"w": SIZE[0], "h": SIZE[1], "fl_x": FOCAL_PX, "fl_y": FOCAL_PX, "cx": SIZE[0] / 2, "cy": SIZE[1] / 2}


def run_python(code: str, *arguments: Path) -> None:
    """Run code in a process of its own, so that this one loads no engine."""
    subprocess.run([sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)], check=True, timeout=120)


class Flight:
    """Twelve photographs taken in, matched, and reconstructed as the factory does it."""

    def __init__(self, folder: Path) -> None:
        self.photos, self.matching = folder / "photos", folder / "sfm_matching" / "files"

    def take_poses(self, given: Path, folder: Path, photos: Path | None = None) -> dict[str, Any]:
        """Run the poses and sfm stages as FROM_MODEL or FROM_POSES would; return the outcome or the first error."""
        photos = photos or self.photos
        read = run_stage("poses", folder / "poses", {"photos": photos, "given": given})
        if "problem" in read:
            return read
        inputs = {"photos": photos, "poses": folder / "poses" / "files"}
        if not read["metrics"]["with_points"]:
            inputs["matching"] = self.matching
        return run_stage("sfm", folder / "sfm", inputs)


@pytest.fixture(scope="module")
def flight(little_flight: Path) -> Flight:
    return Flight(little_flight)


@pytest.fixture(scope="module")
def computed(little_flight: Path) -> Path:
    """Return the files of the sfm stage that computed the poses."""
    return little_flight / "sfm" / "files"


@pytest.fixture(scope="module")
def large_model(flight: Flight, computed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the computed model, turned and scaled, for images three times as large, under the photographs' names."""
    folder = tmp_path_factory.mktemp("large")
    code = """
        import sys, numpy as np, pandas as pd, pycolmap
        model, names = pycolmap.Reconstruction(sys.argv[1]), pd.read_parquet(sys.argv[2])["name"]
        for image in model.images.values():
            image.name = "somewhere/" + names[int(image.name[:6])]
            for point in image.points2D:
                point.xy = point.xy * 3
        for camera in model.cameras.values():
            camera.rescale(3.0)
        turn = np.array([0.1, 0.5, 0.3, 0.8]) / np.linalg.norm([0.1, 0.5, 0.3, 0.8])
        model.transform(pycolmap.Sim3d(0.013, pycolmap.Rotation3d(turn), [3, 4, 5]))
        model.write_binary(sys.argv[3])
    """
    run_python(code, computed / "model", flight.photos / "photos.parquet", folder)
    return folder


def transforms(folder: Path, cam_from_world: np.ndarray, **changes: Any) -> Path:
    """Write the flight's poses as nerfstudio would."""
    folder.mkdir(parents=True, exist_ok=True)
    frames = [
        {"file_path": f"images/photo_{i}.jpg", "transform_matrix": matrix.tolist()}
        for i, matrix in enumerate(homogeneous(world_from_gl(cam_from_world)))
    ]
    (folder / "transforms.json").write_text(json.dumps({**CAMERA, "frames": frames, **changes}))
    return folder


@pytest.fixture(scope="module")
def mega_nerf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the flight's poses by the steps of Mega-NeRF's own scripts/colmap_to_mega_nerf.py; and `evil.pt`.

    That one would make a file `owned` beside it, if it were unpickled as a program may be.
    """
    folder = tmp_path_factory.mktemp("mega_nerf")
    np.save(folder / "poses.npy", poses())
    code = """
        import os, sys, numpy as np, torch
        from pathlib import Path
        folder, focal = Path(sys.argv[1]), float(sys.argv[2])
        drb_from_rdf = torch.tensor([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]], dtype=torch.float64)
        cameras = []
        for pose in np.load(folder / "poses.npy"):
            c2w = torch.eye(4, dtype=torch.float64)
            c2w[:3] = torch.tensor(pose)
            c2w = torch.inverse(c2w)
            turned = drb_from_rdf @ c2w[:3, :3] @ torch.inverse(drb_from_rdf)
            cameras.append(torch.hstack((turned, drb_from_rdf @ c2w[:3, 3:])))
        at = torch.stack([c2w[:, 3] for c2w in cameras])
        origin, scale, lines = (at.max(0)[0] + at.min(0)[0]) / 2, 40.0, []
        for i, c2w in enumerate(cameras):
            metadata = folder / ("val" if i % 5 == 0 else "train") / "metadata"
            metadata.mkdir(parents=True, exist_ok=True)
            c2w[:, 3] = (c2w[:, 3] - origin) / scale
            stored = torch.cat([c2w[:, 1:2], -c2w[:, :1], c2w[:, 2:4]], -1).float()
            torch.save(
                {"H": 240, "W": 320, "c2w": stored, "intrinsics": torch.tensor([focal, focal, 160.0, 120.0]),
                 "distortion": torch.zeros(4)}, metadata / f"{i:06d}.pt")
            lines.append(f"photo_{i}.jpg,{i:06d}.pt\\n")
        (folder / "mappings.txt").write_text("".join(lines))
        torch.save({"origin_drb": origin.float(), "pose_scale_factor": scale}, folder / "coordinates.pt")
        class Evil:
            def __reduce__(self):
                return os.system, (f"touch {folder / 'owned'}",)
        torch.save({"c2w": Evil()}, folder / "evil.pt")
    """
    run_python(code, folder, Path(str(FOCAL_PX)))
    return folder


def most_off(sfm: Path, truth: np.ndarray) -> float:
    """Return the largest difference of any pose's element from the truth, up to a similarity."""
    views = Views.load(sfm / "views.npz")
    fit = fit_similarity(centres(views.cam_from_world), centres(truth))
    return float(np.abs(fit.move_cameras(views.cam_from_world) - truth).max())


def reprojection_px(sfm: Path) -> np.ndarray:
    views, points = Views.load(sfm / "views.npz"), Points.load(sfm / "points.npz")
    tracks, errors = Tracks.load(sfm / "tracks.npz"), []
    for i in range(len(views)):
        seen = tracks.view == i
        in_cam = apply(views.cam_from_world[i], points.xyz[tracks.point[seen]])
        errors.append(np.linalg.norm(project(in_cam, views.intrinsics[i]) - tracks.xy[seen], axis=1))
    return np.concatenate(errors)


def test_true_poses_from_nerfstudio_triangulate(flight: Flight, computed: Path, tmp_path: Path) -> None:
    outcome = flight.take_poses(transforms(tmp_path / "ns", poses()), tmp_path)
    assert (outcome["state"], outcome["metrics"]["registered"]) == ("ok", 12)
    assert most_off(tmp_path / "sfm" / "files", poses()) < 1e-9
    assert abs(outcome["metrics"]["doming_pct"]) < 3 * outcome["metrics"]["doming_sigma_pct"] + 0.1
    assert outcome["metrics"]["rolling_shutter"] == "cannot be told", "too few"
    assert np.median(reprojection_px(tmp_path / "sfm" / "files")) < 0.5
    assert outcome["metrics"]["points"] > 1000
    made = {path.name for path in (tmp_path / "sfm" / "files").iterdir()}
    assert made >= {
        "views.npz",
        "points.npz",
        "tracks.npz",
        "world.json",
        "components.json",
        "images",
        "model",
        "map.png",
    }
    assert made == {path.name for path in computed.iterdir()}
    assert json.loads((tmp_path / "sfm" / "files" / "world.json").read_text())["metric"] is True


def test_the_same_poses_give_the_same_bytes(flight: Flight, tmp_path: Path) -> None:
    given = transforms(tmp_path / "ns", poses())
    flight.take_poses(given, tmp_path / "a")
    flight.take_poses(given, tmp_path / "b")
    first, second = tmp_path / "a" / "sfm" / "files", tmp_path / "b" / "sfm" / "files"
    assert_same_files(first, second)


def test_true_poses_from_mega_nerf_triangulate(flight: Flight, mega_nerf: Path, tmp_path: Path) -> None:
    outcome = flight.take_poses(mega_nerf, tmp_path)
    assert (outcome["state"], outcome["metrics"]["registered"]) == ("ok", 12)
    assert most_off(tmp_path / "sfm" / "files", poses()) < 1e-5  # stored in single precision
    assert np.median(reprojection_px(tmp_path / "sfm" / "files")) < 0.5


def test_a_mega_nerf_file_that_would_run_a_program_is_refused_and_does_not(
    flight: Flight, mega_nerf: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(mega_nerf, tmp_path / "mega")
    shutil.copy(folder / "evil.pt", folder / "train" / "metadata" / "000003.pt")
    error = flight.take_poses(folder, tmp_path)
    assert "train/metadata/000003.pt cannot be read as plain tensors" in error["problem"]
    assert not (mega_nerf / "owned").exists()


@pytest.mark.parametrize("form", ["colmap", "nerfstudio"])
def test_an_exported_scene_comes_back_as_it_was(form: str, flight: Flight, computed: Path, tmp_path: Path) -> None:
    export(computed, flight.photos, form, tmp_path / "out")
    again = take_photos(tmp_path / "out" / "images", tmp_path / "photos")
    read = run_stage("poses", tmp_path / "poses", {"photos": again, "given": tmp_path / "out"})
    assert read["metrics"]["format"] == form
    inputs = {"photos": again, "poses": tmp_path / "poses" / "files"}
    if form == "nerfstudio":
        run_stage("matching", tmp_path / "matching", {"photos": again})
        inputs["matching"] = tmp_path / "matching" / "files"
    outcome = run_stage("sfm", tmp_path / "sfm", inputs)
    assert outcome["state"] == "ok"
    before, after = Views.load(computed / "views.npz"), Views.load(tmp_path / "sfm" / "files" / "views.npz")
    # The copies have no time in them, so their order is that of names.
    order = pd.read_parquet(again / "photos.parquet")["name"].str.removesuffix(".png").tolist()
    names = pd.read_parquet(flight.photos / "photos.parquet")["name"].tolist()
    before = before.take(np.array([names.index(name) for name in order]))
    assert most_off(tmp_path / "sfm" / "files", before.cam_from_world) < 1e-6
    np.testing.assert_allclose(after.intrinsics, before.intrinsics, atol=1e-6)
    if form == "colmap":
        points = Points.load(computed / "points.npz"), Points.load(tmp_path / "sfm" / "files" / "points.npz")
        assert len(points[0].xyz) == len(points[1].xyz)
        np.testing.assert_array_equal(np.sort(points[0].rgb, axis=0), np.sort(points[1].rgb, axis=0))


def test_a_model_for_larger_photographs_in_any_frame_is_scaled_exactly(
    flight: Flight, computed: Path, large_model: Path, tmp_path: Path
) -> None:
    outcome = flight.take_poses(large_model, tmp_path)
    assert (outcome["state"], outcome["metrics"]["registered"]) == ("ok", 12)
    before, after = Views.load(computed / "views.npz"), Views.load(tmp_path / "sfm" / "files" / "views.npz")
    assert most_off(tmp_path / "sfm" / "files", before.cam_from_world) < 1e-6
    np.testing.assert_allclose(after.intrinsics, before.intrinsics, rtol=1e-9)
    np.testing.assert_allclose(
        np.sort(reprojection_px(tmp_path / "sfm" / "files")), np.sort(reprojection_px(computed)), atol=1e-5
    )


def test_a_model_of_another_flight_under_the_same_names(flight: Flight, large_model: Path, tmp_path: Path) -> None:
    photos = take_photos(write_flight(tmp_path / "in", poses(seed=5), seed=9), tmp_path / "photos")
    error = flight.take_poses(large_model, tmp_path, photos)
    assert error["cause"] == "refused"
    assert "the photographs contradict the given poses: 12 of 12 do not fit" in error["problem"]


def test_a_model_of_other_photographs(flight: Flight, computed: Path, tmp_path: Path) -> None:
    error = flight.take_poses(computed / "model", tmp_path)  # its images are called 000000.png, ...
    assert error["cause"] == "refused"
    assert "0 of their 12 names are among the 12 photographs" in error["problem"]
    assert "000000.png" in error["problem"] and "photo_0.jpg" in error["problem"]


@pytest.mark.parametrize("file", ["images.bin", "points3D.bin", "cameras.bin"])
def test_a_damaged_model(file: str, flight: Flight, large_model: Path, tmp_path: Path) -> None:
    damaged = shutil.copytree(large_model, tmp_path / "model") / file
    damaged.write_bytes(damaged.read_bytes()[: damaged.stat().st_size // 2])
    error = flight.take_poses(tmp_path / "model", tmp_path)
    assert error["cause"] == "refused"
    assert f"{damaged.name} is damaged" in error["problem"]


def test_wrong_poses_under_the_right_names(flight: Flight, tmp_path: Path) -> None:
    shuffled = poses()[np.random.default_rng(0).permutation(12)]
    error = flight.take_poses(transforms(tmp_path / "ns", shuffled), tmp_path)
    assert error["cause"] == "refused"
    assert "the photographs contradict the given poses" in error["problem"]


def test_a_wrong_focal_length_is_not_taken_in_silence(flight: Flight, tmp_path: Path) -> None:
    wrong = transforms(tmp_path / "ns", poses(), fl_x=1.3 * FOCAL_PX, fl_y=1.3 * FOCAL_PX)
    outcome = flight.take_poses(wrong, tmp_path)
    assert outcome.get("cause") == "refused" or outcome["state"] == "degraded"


def test_two_poses_that_changed_places_are_left_out_by_name(flight: Flight, tmp_path: Path) -> None:
    swapped = poses()
    swapped[[3, 8]] = swapped[[8, 3]]
    outcome = flight.take_poses(transforms(tmp_path / "ns", swapped), tmp_path)
    assert (outcome["state"], outcome["metrics"]["registered"]) == ("degraded", 10)
    assert "photo_3.jpg, photo_8.jpg" in outcome["notes"][0]
    unplaced = pd.read_parquet(tmp_path / "sfm" / "files" / "unplaced.parquet")
    assert unplaced["name"].tolist() == ["photo_3.jpg", "photo_8.jpg"]
    assert set(unplaced["reason"]) == {"contradicts its given pose"}
    assert most_off(tmp_path / "sfm" / "files", np.delete(poses(), [3, 8], axis=0)) < 1e-9


def test_photographs_without_a_pose_are_named(flight: Flight, tmp_path: Path) -> None:
    folder = transforms(tmp_path / "ns", poses())
    content = json.loads((folder / "transforms.json").read_text())
    content["frames"] = content["frames"][:10]
    (folder / "transforms.json").write_text(json.dumps(content))
    outcome = flight.take_poses(folder, tmp_path)
    assert (outcome["state"], outcome["metrics"]["registered"]) == ("ok", 10)
    assert "2 of 12 photographs have no given pose: photo_10.jpg, photo_11.jpg" in outcome["notes"][0]
