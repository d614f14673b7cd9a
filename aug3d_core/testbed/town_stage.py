"""Build the town, fly over it, and write photographs and truth; photographs that a killed run left behind are kept."""

from __future__ import annotations

import json
import tempfile
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.transforms import centres, homogeneous, invert
from aug3d_core.geometry.views import Views
from aug3d_core.rendering.job import MeshFile, RenderJob, Sunlit
from aug3d_core.rendering.launch import render
from aug3d_core.rendering.sheet import save_sheet
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout
from aug3d_core.testbed import flight
from aug3d_core.testbed.config import TownConfig
from aug3d_core.testbed.model import TexturedMesh
from aug3d_core.testbed.photo import Stamp, save_photo
from aug3d_core.testbed.town import Town, build_town, coloured_mesh

_SHEET = "photos.png"
_START = datetime(2024, 6, 14, 10, 30)  # without a zone, as EXIF times are
_LIGHT = Sunlit(sun_azimuth_deg=152, sun_elevation_deg=47)


def run(inputs: Inputs, config: TownConfig, out: Path, progress: Progress) -> Outcome:
    """Make the photographs that a user would have, and apart from them the truth."""
    start = time.monotonic()
    scene_rng, flight_rng, gps_rng = np.random.default_rng(config.seed).spawn(3)
    progress(0, 1, "building the town")
    town = build_town(config.length_m, config.width_m, scene_rng)
    views = flight.plan_flight(config, flight_rng)
    _write_truth(town, views, out)
    photos = out / layout.TOWN_PHOTOS
    photos.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        rendered = _shoot(town, views, _stamps(config, views, gps_rng), config, photos, Path(scratch), progress)
    _save_sheet(photos, len(views), out)
    seconds = time.monotonic() - start
    metrics = {
        "photos": len(views),
        "seconds_per_photo": seconds / rendered if rendered else None,
        "triangles": len(town.ground.triangles) + len(town.things.triangles),
        "buildings": len(town.footprints),
    }
    return Outcome(metrics=metrics, pictures={"Photographs of the town": _SHEET})


def photo_name(photo_id: int) -> str:
    """Name of a photograph; sorts as it was taken."""
    return f"town_{photo_id:04d}.jpg"


def _shoot(
    town: Town, views: Views, stamps: list[Stamp], config: TownConfig, photos: Path, scratch: Path, progress: Progress
) -> int:
    """Render the shards that lack a photograph; return how many photographs were rendered."""
    meshes = (
        _export(town.ground, town.ground_image, scratch / "ground"),
        _export(town.things, town.things_image, scratch / "things"),
    )
    cameras = scratch / "cameras.npz"
    world_from_cam = homogeneous(invert(views.cam_from_world))
    np.savez(
        cameras, view_id=views.photo_id, world_from_cam=world_from_cam, intrinsics=views.intrinsics, size=views.size
    )
    total, rendered = len(views), 0
    for first in range(0, total, config.photos_per_shard):
        last = min(first + config.photos_per_shard, total)
        if all((photos / photo_name(i)).exists() for i in range(first, last)):
            continue
        job = RenderJob(
            meshes=meshes, cameras=cameras, first=first, last=last, out=scratch / layout.shard_name(first),
            samples=config.samples, light=_LIGHT, depth=False, seed=config.seed,
        )  # fmt: skip
        render(job, lambda done, first=first: progress(first + done, total, "photographs"))
        with np.load(job.out) as shard:
            _develop(shard["rgb"], range(first, last), stamps, config.seed, photos)
        rendered += last - first
    return rendered


def _develop(rgb: UInt8[np.ndarray, "n h w 3"], photo_ids: range, stamps: list[Stamp], seed: int, photos: Path) -> None:
    for image, i in zip(rgb, photo_ids, strict=True):
        # A generator per photograph: its grain must not depend on which shards were rendered before.
        save_photo(photos / photo_name(i), image, stamps[i], np.random.default_rng([seed, i]))


def _export(mesh: TexturedMesh, image: UInt8[np.ndarray, "h w 3"], stem: Path) -> MeshFile:
    file, texture = stem.with_suffix(".npz"), stem.with_suffix(".bmp")
    np.savez(file, vertices=mesh.vertices, triangles=mesh.triangles, uv=mesh.uv)
    Image.fromarray(image).save(texture)
    return MeshFile(path=file, texture=texture)


def _stamps(config: TownConfig, views: Views, rng: np.random.Generator) -> list[Stamp]:
    true_centres: Float[np.ndarray, "n 3"] = centres(views.cam_from_world)
    drifted = true_centres + rng.normal(0, config.gps_noise_m, true_centres.shape)
    measured = geodetic_from_enu(drifted, np.array(flight.ORIGIN_GEODETIC))
    times = [_START + timedelta(seconds=flight.SECONDS_PER_PHOTO * i) for i in range(len(views))]
    return [Stamp(t, config.focal_35mm, *map(float, place)) for t, place in zip(times, measured, strict=True)]


def _write_truth(town: Town, views: Views, out: Path) -> None:
    (out / layout.TOWN_TRUTH).mkdir(exist_ok=True)
    views.save(out / layout.TRUTH_POSES)
    coloured_mesh(town).save(out / layout.TRUTH_MESH)
    origin = dict(zip(("lat_deg", "lon_deg", "alt_m"), flight.ORIGIN_GEODETIC, strict=True))
    footprints = [
        {"outline_m": np.round(f.outline_m, 3).tolist(), "height_m": round(f.height_m, 3), "use": f.use}
        for f in town.footprints
    ]
    text = json.dumps({"origin": origin, "footprints": footprints}, indent=1)
    (out / layout.TRUTH_FOOTPRINTS).write_text(text)


def _save_sheet(photos: Path, count: int, out: Path) -> None:
    chosen = np.unique(np.linspace(0, count - 1, min(count, 24)).astype(int))
    thumbnails = []
    for i in chosen:
        with Image.open(photos / photo_name(int(i))) as image:
            thumbnails.append(np.asarray(image.resize((240, 180), Image.Resampling.LANCZOS)))
    save_sheet(thumbnails, out / _SHEET)
