"""The stage `dataset`: sfm + grouping + depth + surface + sampling + rendering -> one Zarr store.

Without sampling and rendering it packs photographs alone: what a study compares renders with.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.dataset.by_view import joined
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.contact import save_contact_sheet
from aug3d_core.dataset.files import LEAK_AUDIT, SCENE_ZARR
from aug3d_core.dataset.images import CONVENTION, fit
from aug3d_core.dataset.leaks import Check, Sight, audit, report
from aug3d_core.dataset.real import RealViews, pack_real
from aug3d_core.dataset.rendered import RenderedViews, no_rendered, pack_rendered
from aug3d_core.dataset.scaffold import scaffold_depth
from aug3d_core.dataset.scale import ground_distance
from aug3d_core.dataset.scene import REAL, RENDERED, SPLITS, Scene, check, no_fine_images
from aug3d_core.dataset.slab import Slab, slab_of
from aug3d_core.dataset.writer import write
from aug3d_core.domes.files import CAMERAS
from aug3d_core.geometry.footprint import footprints
from aug3d_core.geometry.shared_points import look_positions, visibility
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.photos.files import image_name
from aug3d_core.rendering.files import RENDER_TABLE
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome, Progress
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import BASELINE_MESH, BASELINE_RENDERS, MESH, MESH_SOURCES

_ENLARGED = 1.05  # times: what the eye can see

CONVENTIONS = {
    "world": "z up; east, north, up in metres where the photographs have GPS",
    "camera": "x right, y down, z forward; pixel centres at half-integers",
    "intrinsics": "fx, fy, cx, cy in px",
    "depth, scaffold, near_far": "distance along the camera's z in world units; 0 where unknown",
    "depth": "exact of renders; of training photographs by stereo, where others confirm it",
    "scaffold": "of a mesh made without the test's targets; of a training photograph, from training photographs alone",
    "source": {"real": REAL, "rendered": RENDERED},
    "splits": list(SPLITS),
    "groups/test/members": "a target first, then its inputs, best first",
    "slab": "ground plane z = a x + b y + c; heights above it from low to high",
    "images": CONVENTION,
    "fine_images": "photographs twice as wide and high; 0 of renders",
}
SOURCES = (
    ("sfm", VIEWS),
    ("sfm", POINTS),
    ("grouping", SPLIT_TABLE),
    ("grouping", GROUPS),
    ("surface", MESH),
    ("surface", BASELINE_MESH),
    ("sampling", CAMERAS),
    ("rendering", RENDER_TABLE),
)


def run(inputs: Mapping[str, Path], config: DatasetConfig, out: Path, progress: Progress) -> Outcome:
    """Pack the scene's views and groups, audit them for leaks, and write the store."""
    points = Points.load(inputs["sfm"] / POINTS)
    slab = slab_of(points.xyz, config.outlier_share, config.margin_share)
    with np.load(inputs["grouping"] / GROUPS, allow_pickle=False) as file:
        members, test_members = file["members"], file["test_members"]
    real = pack_real(inputs["sfm"], inputs["grouping"], inputs["depth"], slab, config)
    rendered = (
        pack_rendered(inputs["sampling"], inputs["rendering"], members.shape[1], slab, config)
        if "rendering" in inputs
        else no_rendered(config)
    )
    baseline = _baseline(inputs["sfm"], inputs["surface"], np.unique(test_members[:, 0]), config)
    scene = _assemble(inputs, config, slab, real, rendered, baseline, {"real": members, "test": test_members})
    sources = json.loads((inputs["surface"] / MESH_SOURCES).read_text())
    checks = audit(scene, sources, _sight(inputs["sfm"], points))
    found = [sentence for check in checks if check.hard for sentence in check.found]
    if found:
        raise InputError(
            f"the data set leaks: {found[0]} ({len(found)} in all)", "run the stages from grouping on again"
        )
    scene.attributes["leak_audit"] = report(checks, scene, sources)
    (out / LEAK_AUDIT).write_text(json.dumps(scene.attributes["leak_audit"], indent=1))
    write(
        check(scene, SCENE_ZARR), out / SCENE_ZARR, config.shard_views, lambda done: progress(done, len(scene), "views")
    )
    save_contact_sheet(scene, out / "contact_sheet.png")
    return _outcome(scene, checks, real, rendered, "rendering" in inputs, out)


def _assemble(
    inputs: Mapping[str, Path],
    config: DatasetConfig,
    slab: Slab,
    real: RealViews,
    rendered: RenderedViews,
    baseline: tuple[np.ndarray, np.ndarray, np.ndarray],
    groups: dict[str, np.ndarray],
) -> Scene:
    n, m, k = len(real.images), len(rendered.images), groups["real"].shape[1]
    train = real.splits == SPLITS.index("train")
    size_px = (config.width_px, config.height_px)
    scaffold = scaffold_depth(inputs["surface"], train, real.world_from_cam, real.intrinsics, size_px)
    groups = groups | {"rendered": n + np.arange(m).reshape(-1, k)}
    return Scene(
        images=joined(real.images, rendered.images),
        fine_images=joined(real.fine_images, no_fine_images(m, size_px)),
        alpha=joined(real.alpha, rendered.alpha),
        depth=joined(real.depth, rendered.depth),
        scaffold=joined(scaffold, rendered.depth),
        world_from_cam=np.concatenate([real.world_from_cam, rendered.world_from_cam]),
        intrinsics=np.concatenate([real.intrinsics, rendered.intrinsics]),
        near_far=np.concatenate([real.near_far, rendered.near_far]),
        source=np.repeat([REAL, RENDERED], [n, m]).astype(np.uint8),
        photo_id=np.concatenate([Views.load(inputs["sfm"] / VIEWS).photo_id, np.full(m, -1)]).astype(np.int32),
        dome_id=np.concatenate([np.full(n, -1), rendered.dome_id]).astype(np.int32),
        splits=np.concatenate([real.splits, np.full(m, SPLITS.index("train"))]).astype(np.uint8),
        groups={name: rows.astype(np.int32) for name, rows in groups.items()},
        baseline_view=baseline[0].astype(np.int32),
        baseline_images=baseline[1],
        baseline_alpha=baseline[2],
        slab=slab,
        scale=ground_distance(slab, real.world_from_cam, real.intrinsics, real.near_far, size_px),
        attributes={
            "conventions": CONVENTIONS,
            "config": config.model_dump(mode="json"),
            "counts": {"real": n, "rendered": m, "groups_real": len(groups["real"]), "groups_rendered": m // k},
            "inputs": {f"{stage}/{name}": _digest(inputs[stage] / name) for stage, name in SOURCES if stage in inputs},
        },
    )


def _sight(sfm: Path, points: Points) -> Sight:
    tracks, count = Tracks.load(sfm / TRACKS), len(Views.load(sfm / VIEWS))
    look, _ = look_positions(tracks, points.xyz, count)
    return Sight(look, footprints(tracks, points.xyz, look), visibility(tracks, count, len(points.xyz)))


def _baseline(
    sfm: Path, surface: Path, targets: np.ndarray, config: DatasetConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (view, colour, alpha) of the mesh rendered at each target's pose."""
    photo_id = Views.load(sfm / VIEWS).photo_id
    colours, alphas = [], []
    for view in targets:
        with Image.open(surface / BASELINE_RENDERS / image_name(int(photo_id[view]))) as image:
            rgba = np.asarray(image.convert("RGBA"))
        crop = fit(rgba.shape[1], rgba.shape[0], config.width_px, config.height_px)
        colour, alpha, _ = crop.covered(rgba[..., :3], rgba[..., 3], np.zeros(rgba.shape[:2], np.float32))
        colours.append(colour)
        alphas.append(alpha)
    return targets, np.stack(colours), np.stack(alphas)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _outcome(
    scene: Scene, checks: list[Check], real: RealViews, rendered: RenderedViews, renders_wanted: bool, out: Path
) -> Outcome:
    size = sum(file.stat().st_size for file in (out / SCENE_ZARR).rglob("*") if file.is_file())
    notes = []
    if rendered.domes_dropped:
        notes.append(f"{rendered.domes_dropped} domes lost a view to the render checks and are no groups")
    if renders_wanted and not len(rendered.images):
        why = "no dome is left whole" if rendered.domes_dropped else "no virtual views were planned"
        notes.append(f"{why}: the data set holds photographs alone")
    for what, times, remedy in (
        ("photographs", real.enlarged, "make the data set's views smaller (`dataset.width_px`, `dataset.height_px`)"),
        ("renders", rendered.enlarged, "make them as large as the views (`sampling.width_px`, `sampling.height_px`)"),
    ):
        if times > _ENLARGED:
            notes.append(
                f"{what} are enlarged {times:.2g} times for views of {scene.width_px} x {scene.height_px} px, and soft"
                f" in them: {remedy}"
            )
    notes += [f"leak audit: {check.name} is {check.figure:g}, not {check.rule}" for check in checks if not check.passed]
    return Outcome(
        metrics={
            "views": len(scene),
            "real": len(real.images),
            "rendered": len(rendered.images),
            "groups_real": len(scene.groups["real"]),
            "groups_rendered": len(scene.groups["rendered"]),
            "groups_test": len(scene.groups["test"]),
            "domes_dropped": rendered.domes_dropped,
            "kept_by_crop_share": round(real.kept_share, 4),
            "slab_thickness": round(scene.slab.high - scene.slab.low, 4),
            "bytes": size,
            "leak_audit": scene.attributes["leak_audit"]["state"],
            **{check.metric: check.figure for check in checks},
        },
        state="degraded" if rendered.domes_dropped and not len(rendered.images) else "ok",
        notes=tuple(notes),
        pictures={"Groups: real, rendered, test (a row each)": "contact_sheet.png"},
    )
