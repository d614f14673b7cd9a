"""Build the town, fly over it, and write photographs and truth; photographs that a killed run left behind are kept."""

from __future__ import annotations

import json
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.rendering.sheet import save_sheet
from aug3d_core.run.scratch import scratch_folder
from aug3d_core.run.stage import Inputs, Order, Outcome, Progress, from_elsewhere
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.develop import Darkroom, rendered_views
from aug3d_core.town.drone.flight import SECONDS_PER_PHOTO, plan_flight
from aug3d_core.town.drone.gps import ORIGIN_GEODETIC, measured_places
from aug3d_core.town.drone.lens import Lens
from aug3d_core.town.drone.photo import Stamp
from aug3d_core.town.drone.sensor import Defects
from aug3d_core.town.drone.studio import Studio
from aug3d_core.town.files import TOWN_PHOTOS, TOWN_TRUTH, TRUTH_FOOTPRINTS, TRUTH_LENS, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.generator.terrain import terrain_of
from aug3d_core.town.generator.town import Town, build_town, coloured_mesh

_SHEET = "photos.png"
_START = datetime(2024, 6, 14, 10, 30)  # without a zone, as EXIF times are


def run(inputs: Inputs, config: TownConfig, out: Path, progress: Progress) -> Outcome:
    """Make the photographs that a user would have, and apart from them the truth."""
    start = time.monotonic()
    town, photos, rendered = _fly(config, out, progress, list)
    _save_sheet(out / TOWN_PHOTOS, photos, out)
    seconds = time.monotonic() - start
    metrics = {
        "photos": photos,
        "seconds_per_photo": seconds / rendered if rendered else None,
        "triangles": len(town.ground.triangles) + len(town.things.triangles),
        "buildings": len(town.footprints),
    }
    return Outcome(metrics=metrics, pictures={"Photographs of the town": _SHEET})


def assist(inputs: Inputs, config: TownConfig, out: Path, progress: Progress) -> Outcome:
    """Make photographs that are not there yet."""
    return Outcome(metrics={"photos": _fly(config, out, progress, from_elsewhere)[2]})


def _fly(config: TownConfig, out: Path, progress: Progress, ordered: Order) -> tuple[Town, int, int]:
    """Write truth and photographs; return the town, the number of photographs, and of those that were rendered."""
    scene_rng, flight_rng, gps_rng, defects_rng = np.random.default_rng(config.seed).spawn(4)
    lens = Lens.of(config)
    progress(0, 1, "building the town")
    terrain = terrain_of(config)
    town = build_town(config, terrain, scene_rng)
    views = plan_flight(config, flight_rng, terrain)
    _write_truth(town, views, lens, out)
    photos = out / TOWN_PHOTOS
    photos.mkdir(exist_ok=True)
    darkroom = Darkroom(
        views=rendered_views(views, lens), terrain=terrain, lens=lens, defects=Defects.of(config, len(views), defects_rng),
        stamps=_stamps(config, views, gps_rng), noise_levels=config.noise_levels, seed=config.seed,
    )  # fmt: skip
    shards = ordered(range(0, len(views), config.photos_per_shard))
    with scratch_folder(out / "studio") as scratch:
        rendered = _shoot(town, darkroom, config, photos, scratch, progress, shards)
    return town, len(views), rendered


def photo_name(photo_id: int) -> str:
    """Name of a photograph; sorts as it was taken."""
    return f"town_{photo_id:04d}.jpg"


def _shoot(
    town: Town,
    darkroom: Darkroom,
    config: TownConfig,
    photos: Path,
    scratch: Path,
    progress: Progress,
    shards: list[int],
) -> int:
    """Render the shards, by their first photograph, that lack one; return how many photographs were rendered."""
    studio, total, rendered = Studio.of(town, darkroom.views, config, scratch), len(darkroom.views), 0
    for first in shards:
        last = min(first + config.photos_per_shard, total)
        if all((photos / photo_name(i)).exists() for i in range(first, last)):
            continue
        rgb, alpha, _ = studio.shoot(
            first, last, lambda done, first=first: progress(first + done, total, "photographs")
        )
        for i in range(first, last):
            darkroom.develop(rgb[i - first], alpha[i - first], i, photos / photo_name(i))
        rendered += last - first
    return rendered


def _stamps(config: TownConfig, views: Views, rng: np.random.Generator) -> list[Stamp]:
    measured = measured_places(config, centres(views.cam_from_world), rng)
    focal_35mm = round(config.focal_35mm * config.exif_focal_factor) or None
    return [
        Stamp(
            time=_START + timedelta(seconds=SECONDS_PER_PHOTO * i),
            focal_35mm=focal_35mm,
            place=None if measured is None else (float(measured[i, 0]), float(measured[i, 1]), float(measured[i, 2])),
        )
        for i in range(len(views))
    ]


def _write_truth(town: Town, views: Views, lens: Lens, out: Path) -> None:
    (out / TOWN_TRUTH).mkdir(exist_ok=True)
    views.save(out / TRUTH_POSES)
    coloured_mesh(town).save(out / TRUTH_MESH)
    centre = [lens.width_px / 2, lens.height_px / 2]
    camera = {"model": "RADIAL", "params": [lens.focal_px, *centre, lens.k1, lens.k2]}
    (out / TRUTH_LENS).write_text(json.dumps(camera | {"width": lens.width_px, "height": lens.height_px}, indent=1))
    origin = dict(zip(("lat_deg", "lon_deg", "alt_m"), ORIGIN_GEODETIC, strict=True))
    footprints = [
        {"outline_m": np.round(f.outline_m, 3).tolist(), "height_m": round(f.height_m, 3), "use": f.use}
        for f in town.footprints
    ]
    text = json.dumps({"origin": origin, "footprints": footprints}, indent=1)
    (out / TRUTH_FOOTPRINTS).write_text(text)


def _save_sheet(photos: Path, count: int, out: Path) -> None:
    chosen = np.unique(np.linspace(0, count - 1, min(count, 24)).astype(int))
    thumbnails = []
    for i in chosen:
        with Image.open(photos / photo_name(int(i))) as image:
            thumbnails.append(np.asarray(image.resize((240, 180), Image.Resampling.LANCZOS)))
    save_sheet(thumbnails, out / _SHEET)
