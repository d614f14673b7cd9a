"""What `aug3d advise` is worth: the virtual drone flies the advice, and as many photographs in lines and at random.

A town is flown with a gap. Photographs that nobody sees were taken all over it, in the gap too, as the flight's own: they
judge. What 20 more photographs add is the PSNR of the shipped model on them, and the F-score of the mesh where the whole
flight looks.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from PIL import Image

from aug3d_core.advice.choice import pose
from aug3d_core.advice.mission import Waypoint, waypoints
from aug3d_core.advice.plan import Plan, plan_of
from aug3d_core.bench.figure import Figure, at_least, in_own_process
from aug3d_core.dataset.images import fit
from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import centres, homogeneous, invert
from aug3d_core.geometry.views import Views
from aug3d_core.judging.summary import interval
from aug3d_core.photos.files import read_photos
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.surface.files import BASELINE_MESH
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.develop import Darkroom, rendered_views
from aug3d_core.town.drone.gps import ORIGIN_GEODETIC, measured_places
from aug3d_core.town.drone.lens import Lens
from aug3d_core.town.drone.photo import Stamp
from aug3d_core.town.drone.sensor import Defects
from aug3d_core.town.drone.studio import Studio
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.generator.terrain import terrain_of
from aug3d_core.town.generator.town import build_town
from aug3d_core.town.truth.mesh_errors import compare_meshes
from aug3d_core.town.truth.pose_errors import extent_m

TOWNS = (
    ("town.seed=7",),
    ("town.seed=11", "town.terrain=slope", "town.buildings=suburb"),
    ("town.seed=23", "town.path=nadir", "town.buildings=dense"),
)
MORE, MARGIN_M = 20, 15.0
_JUDGES = (8, 5)  # cells from west to east, from south to north, with a photograph each that judges
_GAP = (-45.0, 45.0, -20.0, np.inf)  # west, east, south, north [m]: no photograph is taken from there
_SIZE_PX, _INPUTS = (256, 192), 3
_WITHIN = 0.01  # of the extent: distance of the F-score
_LATER = datetime(2024, 6, 15, 10, 30)


@dataclass(frozen=True)
class Flown:
    """A town as it was flown. given: which photographs anybody sees. judges: those that nobody does, with their true poses."""

    config: TownConfig
    truth: Views
    mesh: Mesh
    photos: Sequence[Path]
    given: Bool[np.ndarray, " n"]
    judges: Sequence[Path]
    judged_from: Float[np.ndarray, "t 3 4"]


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return what the advice adds on each town, beside the better of lines and random places."""
    found: dict[str, Figure] = {}
    gains: dict[str, list[tuple[float, float]]] = {}
    clearance = []
    for number, overrides in enumerate(TOWNS):
        flown = _flown(store, scene, overrides, say)
        scores = {}
        for arm, trial, plan in _arms(store, scene, flown, number, say):
            if trial.failure:
                return found | {f"town{number}_{arm}": Figure(None, "", None, None, trial.failure)}
            scores[arm] = _judged(store, trial, flown)
            found[f"town{number}_{arm}_psnr"] = Figure(scores[arm][0], "dB")
            found[f"town{number}_{arm}_fscore"] = Figure(scores[arm][1], "share")
            if plan is not None:
                clearance.append(_clearance(plan, flown))
        before = scores.pop("before")
        for arm, (psnr, fscore) in scores.items():
            gains.setdefault(arm, []).append((psnr - before[0], fscore - before[1]))
    for arm, gained in gains.items():
        found |= {
            f"{arm}_adds_db": Figure(float(np.mean([db for db, _ in gained])), "dB"),
            f"{arm}_adds_fscore": Figure(float(np.mean([fscore for _, fscore in gained])), "share"),
        }
    advised, others = gains.pop("advice"), [*gains.values()]
    best = np.array([max(arm[town][0] for arm in others) for town in range(len(TOWNS))])
    lead = np.array([db for db, _ in advised]) - best
    ends = interval(lead)
    return found | {
        "advice_gain_over_best_other": _gain(float(np.mean([db for db, _ in advised])), float(best.mean())),
        "advice_over_best_other_db": Figure(float(lead.mean()), "dB"),
        "advice_over_best_other_db_low": Figure(ends[0] if ends else None, "dB"),
        "advice_least_clearance": at_least(MARGIN_M, min(clearance), "m above the highest roof"),
    }


def _gain(advised_db: float, other_db: float) -> Figure:
    """Return how many times what the best other adds [dB] the advice adds; where that adds nothing, what the advice adds."""
    if other_db > 0:
        return at_least(2.0, advised_db / other_db, "ratio")
    return Figure(advised_db, "dB, where the best other adds none", 0.0, advised_db > 0)


def _flown(store: Store, scene: Measured, overrides: Sequence[str], say: Say) -> Flown:
    town = run_trial(store, "town", scene, overrides, directly(store, say)).records["town"]
    folder, config = store.files_dir(town), scene.config(overrides).town
    truth = Views.load(folder / TRUTH_POSES)
    east, north, _ = centres(truth.cam_from_world).T
    west_end, east_end, south_end, north_end = _GAP
    in_gap = (east > west_end) & (east < east_end) & (north > south_end) & (north < north_end)
    photos = sorted((folder / TOWN_PHOTOS).iterdir())
    judged_from = _anywhere(config, truth)
    judges = fly(config, judged_from, store.root / f"judges_{config.seed}", say)
    return Flown(config, truth, Mesh.load(folder / TRUTH_MESH), photos, ~in_gap, judges, judged_from)


def _anywhere(config: TownConfig, truth: Views) -> Float[np.ndarray, "t 3 4"]:
    """Return poses over the flight, one in each cell, as high and as tilted, along its lines either way."""
    rng, at, terrain = np.random.default_rng([config.seed, 1]), centres(truth.cam_from_world)[:, :2], terrain_of(config)
    pitch = -90.0 if config.path == "nadir" else config.tilt_deg - 90
    low, high = at.min(axis=0), at.max(axis=0)
    cell = np.stack(np.meshgrid(*map(np.arange, _JUDGES)), axis=-1).reshape(-1, 2)
    found = []
    for x, y in low + (cell + rng.uniform(size=cell.shape)) / _JUDGES * (high - low):
        z = config.altitude_m + float(terrain.trend_in_world(x, y))
        found.append(pose(np.array([x, y, z]), float(rng.choice([90.0, 270.0])), pitch))
    return np.stack(found)


def _arms(store: Store, scene: Measured, flown: Flown, number: int, say: Say):
    """Yield the name, the reconstruction and the plan of each way to take more photographs; before: without any."""
    given = [photo for photo, so in zip(flown.photos, flown.given, strict=True) if so]
    folder = store.root / f"flown_{number}"
    before = _made(store, scene, given, folder / "before", say)
    yield "before", before, None
    if before.failure:
        return
    sfm, surface = (store.files_dir(before.records[name]) for name in ("sfm", "surface"))
    plan = plan_of(sfm, surface, [], MORE, MARGIN_M)
    for arm, poses in _ways(plan, flown, np.random.default_rng([number])).items():
        photos = fly(flown.config, poses, store.root / f"photos_{number}_{arm}", say)
        yield arm, _made(store, scene, [*given, *photos], folder / arm, say), plan if arm == "advice" else None


def _ways(plan: Plan, flown: Flown, rng: np.random.Generator) -> Mapping[str, Float[np.ndarray, "n 3 4"]]:
    """Return the true poses of each way, over the same area. All are flown by their coordinates on earth."""
    assert plan.origin is not None
    points = waypoints(plan.choice.advised, plan.origin, plan.lowest_ground)
    advice = [pose(xyz, one.yaw_deg, one.pitch_deg) for xyz, one in zip(_flown_at(points), points, strict=True)]
    wanted, pitch = plan.site.area.middle(plan.site.area.wanted), flown.config.tilt_deg - 90
    pitch = -90.0 if flown.config.path == "nadir" else pitch
    low, high = wanted.min(axis=0), wanted.max(axis=0)
    across = max(round(float(np.sqrt(MORE * (high[1] - low[1]) / (high[0] - low[0])))), 1)
    along = -(-MORE // across)
    lines = [
        (low + (np.array([column, row]) + 0.5) / [along, across] * (high - low), 90.0 if row % 2 == 0 else 270.0)
        for row in range(across)
        for column in (range(along) if row % 2 == 0 else range(along)[::-1])
    ][:MORE]
    drawn = [(one, rng.uniform(0, 360)) for one in rng.permutation(wanted)[:MORE]]
    ways = {"advice": np.stack(advice)}
    for arm, places in (("lines", lines), ("random", drawn)):
        on_earth = geodetic_from_enu(plan.site.flown(np.array([xy for xy, _ in places])), plan.origin)
        there = enu_from_geodetic(on_earth, np.array(ORIGIN_GEODETIC))
        ways[arm] = np.stack([pose(xyz, yaw, pitch) for xyz, (_, yaw) in zip(there, places, strict=True)])
    return ways


def _flown_at(points: Sequence[Waypoint]) -> Float[np.ndarray, "n 3"]:
    """Return where waypoints are in the town's true frame [m]."""
    on_earth = np.array([[one.lat_deg, one.lon_deg, one.alt_m] for one in points])
    return enu_from_geodetic(on_earth, np.array(ORIGIN_GEODETIC))


def _clearance(plan: Plan, flown: Flown) -> float:
    """Return how far the lowest waypoint lies above the highest thing of the whole town [m]."""
    assert plan.origin is not None
    points = waypoints(plan.choice.advised, plan.origin, plan.lowest_ground)
    return float(_flown_at(points)[:, 2].min() - flown.mesh.xyz[:, 2].max())


def fly(config: TownConfig, cam_from_world: Float[np.ndarray, "n 3 4"], folder: Path, say: Say) -> list[Path]:
    """Take photographs of a town from true poses, a day after its flight; the same that were taken before are kept."""
    asked = hashlib.sha256(config.model_dump_json().encode() + cam_from_world.tobytes()).hexdigest()
    folder = folder / asked[:16]
    count, lens, terrain = len(cam_from_world), Lens.of(config), terrain_of(config)
    files = [folder / f"zz_more_{i:03d}.jpg" for i in range(count)]
    if all(file.exists() for file in files):
        return files
    scene_rng, _, _, _ = np.random.default_rng(config.seed).spawn(4)
    town = build_town(config, terrain, scene_rng)
    intrinsics = np.array([config.focal_px, config.focal_px, config.width_px / 2, config.height_px / 2])
    size = np.tile([config.width_px, config.height_px], (count, 1))
    views = Views(np.arange(count), cam_from_world, np.tile(intrinsics, (count, 1)), size)
    places = measured_places(config, centres(cam_from_world), np.random.default_rng([config.seed, count]))
    assert places is not None
    stamps = [
        Stamp(_LATER + timedelta(seconds=5 * i), config.focal_35mm, (place[0], place[1], place[2]))
        for i, place in enumerate(places.tolist())
    ]
    darkroom = Darkroom(
        views=rendered_views(views, lens), terrain=terrain, lens=lens, defects=Defects(np.zeros(count), np.ones(count)),
        stamps=stamps, noise_levels=config.noise_levels, seed=config.seed + 1,
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        studio = Studio.of(town, darkroom.views, config, Path(scratch))
        rgb, alpha, _ = studio.shoot(0, count, lambda done: say("drone", done, count, "photographs"))
    for i, file in enumerate(files):
        darkroom.develop(rgb[i], alpha[i], i, file)
    return files


def _made(store: Store, scene: Measured, photos: Sequence[Path], folder: Path, say: Say) -> Trial:
    """Reconstruct photographs, to the mesh."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for photo in photos:
        shutil.copy(photo, folder)
    return run_trial(store, "surface", scene, (), directly(store, say), folder)


def _judged(store: Store, trial: Trial, flown: Flown) -> tuple[float, float]:
    """Return PSNR on the photographs that judge, and the F-score of the mesh over the whole flight."""
    sfm, photos, surface = (store.files_dir(trial.records[name]) for name in ("sfm", "photos", "surface"))
    true_from_found = laid_over_truth(sfm, photos, flown)
    mesh = Mesh.load(surface / BASELINE_MESH)
    mesh = replace(mesh, xyz=true_from_found.apply(mesh.xyz.astype(float)))
    errors = compare_meshes(mesh, flown.mesh, flown.truth, np.random.default_rng(0))
    poses = true_from_found.inverse().move_cameras(flown.judged_from)
    scores = in_own_process(partial(predicted_psnr, sfm, poses, flown.judges, flown.truth.intrinsics[0]))
    return float(np.mean(scores)), errors.score(_WITHIN * extent_m(flown.truth)).fscore


def laid_over_truth(sfm: Path, photos: Path, flown: Flown) -> Similarity:
    """Return how a reconstruction lies over the truth, by the cameras of the flight's own photographs."""
    views, table = Views.load(sfm / VIEWS), read_photos(photos)
    names = dict(zip(table["photo_id"], table["name"], strict=True))
    number = {photo.name: i for i, photo in enumerate(flown.photos)}
    pairs = [(i, number[names[photo]]) for i, photo in enumerate(views.photo_id.tolist()) if names[photo] in number]
    found, true = np.array(pairs).T
    return fit_similarity(centres(views.cam_from_world[found]), centres(flown.truth.cam_from_world[true]))


def predicted_psnr(
    sfm: Path, cam_from_world: Float[np.ndarray, "t 3 4"], truths: Sequence[Path], intrinsics: Float[np.ndarray, " 4"]
) -> list[float]:
    """Return the PSNR of the shipped model on photographs that a reconstruction never had, by their poses in its world [dB]."""
    from aug3d_core.dataset.new_views import with_views  # with torch, which must not meet open3d in one process
    from aug3d_core.dataset.photographs import scene_of_photographs
    from aug3d_core.heads import saved
    from aug3d_core.heads.config import shipped
    from aug3d_core.judging.scores import psnr
    from aug3d_core.novel.inputs import inputs_of

    scene, head = scene_of_photographs(sfm, _SIZE_PX), saved.load(shipped()[0])
    with Image.open(truths[0]) as image:
        crop = fit(*image.size, *_SIZE_PX)
    poses = homogeneous(invert(cam_from_world))
    wider, rows = with_views(scene, poses, crop.intrinsics(intrinsics), np.arange(len(scene)))
    scores = []
    for row, file in zip(rows.tolist(), truths, strict=True):
        view = head.predict(wider, row, inputs_of(wider, row, np.arange(len(scene)), _INPUTS))
        with Image.open(file) as image:
            scores.append(psnr(crop.colour(np.asarray(image.convert("RGB"))), view.colour))
    return scores
