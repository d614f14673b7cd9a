"""The stage `exact_town`: a town and its flight -> a data set, straight from the truth."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float16, UInt8

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.contact import save_contact_sheet
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.images import CONVENTION
from aug3d_core.dataset.scene import FINER, RENDERED, SPLITS, Scene, check
from aug3d_core.dataset.slab import slab_of
from aug3d_core.dataset.writer import write
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.geometry.views import Views
from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear
from aug3d_core.run.errors import InputError
from aug3d_core.run.scratch import scratch_folder
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.town.drone.develop import Darkroom
from aug3d_core.town.drone.flight import plan_flight
from aug3d_core.town.drone.lens import Lens
from aug3d_core.town.drone.sensor import Defects
from aug3d_core.town.drone.studio import Studio
from aug3d_core.town.exact.config import ExactTownConfig
from aug3d_core.town.exact.groups import grouped, net_points
from aug3d_core.town.generator.terrain import terrain_of
from aug3d_core.town.generator.town import build_town

_TEXELS = 2.5  # of the ground's texture in a photograph's pixel
_ONE_SURFACE = 1.02  # times as far: parts of a pixel show the same surface
_GROUND = 0.5  # quantile of the distances along z that is the scene's scale
_CONVENTIONS = {
    "world": "z up; east, north, up in metres",
    "camera": "x right, y down, z forward; pixel centres at half-integers",
    "intrinsics": "fx, fy, cx, cy in px",
    "depth, scaffold, near_far": "exact distance along the camera's z in metres; 0 in the sky",
    "splits": list(SPLITS),
    "slab": "ground plane z = a x + b y + c; heights above it from low to high",
    "images": CONVENTION,
    "fine_images": "views twice as wide and high",
}


def run(inputs: Inputs, config: ExactTownConfig, out: Path, progress: Progress) -> Outcome:
    """Build the town, photograph it at the size of the fine images, and pack it."""
    start, town_config = time.monotonic(), config.town
    scene_rng, flight_rng, defects_rng, camera_rng = np.random.default_rng(town_config.seed).spawn(4)
    terrain, lens = terrain_of(town_config), Lens.of(town_config)
    if lens.bends:
        raise InputError(
            "a town that is packed from its truth has a pinhole camera", "set radial_k1 and radial_k2 to 0"
        )
    views = plan_flight(town_config, flight_rng, terrain)
    if len(views) < config.k:
        raise InputError(f"the flight has {len(views)} photographs, a group has {config.k}", "fly with more overlap")
    progress(0, len(views), "building the town")
    texel_m = town_config.altitude_m / town_config.focal_px / _TEXELS
    town = build_town(town_config, terrain, scene_rng, texel_m)
    with scratch_folder(out / "studio") as scratch:
        fine_views = replace(views, intrinsics=FINER * views.intrinsics, size=FINER * views.size)
        samples = -(-town_config.samples // FINER**2)  # of a pixel as many as are asked for, or a few more
        fine_config = town_config.model_copy(update={"samples": samples})
        studio = Studio.of(town, fine_views, fine_config, scratch, depth=True)
        rgb, alpha, fine_depth = studio.shoot(0, len(views), lambda done: progress(done, len(views), "photographs"))
    assert fine_depth is not None
    darkroom = Darkroom(
        views=fine_views, terrain=terrain, lens=lens, defects=Defects.of(town_config, len(views), defects_rng), stamps=[],
        noise_levels=town_config.noise_levels, seed=town_config.seed,
    )  # fmt: skip
    exposed = [darkroom.exposed(rgb[view], alpha[view], view) for view in range(len(views))]
    fine = np.stack([_shot(image, config, camera_rng) for image in exposed])
    scene = _scene(views, fine, np.stack([_of_parts(depth) for depth in fine_depth]), config)
    write(check(scene, SCENE_ZARR), out / SCENE_ZARR, config.shard_views)
    save_contact_sheet(scene, out / "contact_sheet.png")
    return Outcome(
        metrics={
            "views": len(views),
            "groups_rendered": len(scene.groups["rendered"]),
            "buildings": len(town.footprints),
            "slab_thickness": round(scene.slab.high - scene.slab.low, 2),
            "seconds_per_view": round((time.monotonic() - start) / len(views), 3),
        },
        pictures={"Groups of the town": "contact_sheet.png"},
    )


def _shot(
    rgb: UInt8[np.ndarray, "h w 3"], config: ExactTownConfig, rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture as a camera takes it that exposes and balances white by itself, with its noise."""
    gain = np.exp(rng.normal(0, config.exposure_spread) + rng.normal(0, config.white_spread, 3) * [1, 0, 1])
    light = srgb_from_linear(linear_from_srgb(rgb) * gain)
    noisy = light + rng.normal(0, config.town.noise_levels, rgb.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _of_parts(fine: Float16[np.ndarray, "h2 w2"]) -> Float16[np.ndarray, "h w"]:
    """Return the depth of pixels by that of their parts: the middle of a surface, the nearest of several; 0 in the sky."""
    parts = np.where(fine > 0, fine, np.inf).astype(float)
    parts = parts.reshape(len(fine) // FINER, FINER, -1, FINER)
    nearest, farthest = parts.min(axis=(1, 3)), parts.max(axis=(1, 3))
    middle = 1 / (1 / parts).mean(axis=(1, 3))  # 1 / depth is linear in the image of a plane
    found = np.where(farthest <= _ONE_SURFACE * nearest, middle, nearest)
    return np.where(np.isfinite(found), found, 0).astype(np.float16)


def _scene(
    views: Views, fine: UInt8[np.ndarray, "n h2 w2 3"], depth: Float16[np.ndarray, "n h w"], config: ExactTownConfig
) -> Scene:
    n, (height, width) = len(views), depth.shape[1:]
    images = np.rint(fine.reshape(n, height, FINER, width, FINER, 3).mean(axis=(2, 4))).astype(np.uint8)
    slab = slab_of(np.concatenate(net_points(views, depth)), config.outlier_share, config.margin_share)
    world_from_cam = homogeneous(invert(views.cam_from_world))
    seen = [np.asarray(one[one > 0], float) for one in depth]
    if bare := [view for view, depths in enumerate(seen) if not len(depths)]:
        raise InputError(f"photograph {bare[0]} of the flight shows nothing but sky", "tilt the camera down")
    bounds = [
        near_far(slab, pose, intrinsics, (width, height), depths)
        for pose, intrinsics, depths in zip(world_from_cam, views.intrinsics, seen, strict=True)
    ]
    none = np.zeros((0, config.k), np.int32)
    groups = grouped(views, depth, config.k)
    return Scene(
        images=images,
        fine_images=fine,
        alpha=np.full((n, height, width), 255, np.uint8),
        depth=depth,
        scaffold=depth,
        world_from_cam=world_from_cam,
        intrinsics=views.intrinsics.astype(float),
        near_far=np.array(bounds),
        source=np.full(n, RENDERED, np.uint8),
        photo_id=np.full(n, -1, np.int32),
        dome_id=np.full(n, -1, np.int32),
        splits=np.full(n, SPLITS.index("train"), np.uint8),
        groups={"real": none, "rendered": groups, "test": none},
        baseline_view=np.zeros(0, np.int32),
        baseline_images=images[:0],
        baseline_alpha=np.zeros((0, height, width), np.uint8),
        slab=slab,
        scale=float(np.median([np.quantile(depths, _GROUND) for depths in seen])),
        attributes={"conventions": _CONVENTIONS, "config": config.model_dump(mode="json"), "counts": {"rendered": n}},
    )
