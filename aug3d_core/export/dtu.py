"""The groups of a packed scene -> the DTU layout that the original pixelNeRF code reads, one scan per group.

    DIR/aug3d/new_train.lst, new_val.lst, new_test.lst     names of scans, one per line
    DIR/aug3d/<scan>/image/000000.png ...                  a group's views in its order; in a test group the target is first
    DIR/aug3d/<scan>/cameras.npz                           for view i: world_mat_i = K [R|t] and scale_mat_i, both 4 x 4

Its loader (`DVRDataset`, `sub_format="dtu"`) extracts K, R and the camera's centre from `world_mat_i`, subtracts the
translation of `scale_mat_i` from the centre and divides by its diagonal. It samples rays between 0.1 and 5 along unit
directions. It assumes pixel centres at integers; ours are at half-integers. It averages K over a scan.

Every tenth training scan is for validation. Test scans show ground that is never trained on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from PIL import Image

from aug3d_core.dataset.bounds import edge_rays
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene
from aug3d_core.export.target_folder import filling
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError

CATEGORY = "aug3d"
NEAR, FAR = 0.1, 5.0  # the loader's bounds for DTU, in scaled units along unit directions
_FARTHEST = 4.9  # scaled distance of a scan's farthest point, a little below FAR
_VALIDATION = 10


@dataclass(frozen=True)
class Written:
    """What was written: scans by list, total views, and the largest difference of a view's K from its scan's mean [px]."""

    scans: dict[str, int]
    views: int
    intrinsics_off_px: float


def export_dtu(dataset: Path, folder: Path) -> Written:
    """Write every group of a packed scene as a scan.

    Raises UsageError if the folder is not empty, InputError if the store is damaged or near and far do not fit the loader.
    """
    with filling(folder):
        scene = read(dataset / SCENE_ZARR)
        base, off_px, views = folder / CATEGORY, [0.0], 0
        lists: dict[str, list[str]] = {"train": [], "val": [], "test": []}
        for kind in ("real", "rendered", "test"):
            for number, members in enumerate(scene.groups[kind]):
                scan = f"{kind}_{number:05d}"
                _write_scan(scene, members, base / scan, scan)
                lists[
                    "test" if kind == "test" else "val" if number % _VALIDATION == _VALIDATION - 1 else "train"
                ].append(scan)
                k = scene.intrinsics[members]
                off_px.append(float(np.abs(k - k.mean(axis=0)).max()))
                views += len(members)
        for name, scans in lists.items():
            (base / f"new_{name}.lst").write_text("".join(f"{scan}\n" for scan in scans))
        return Written({name: len(scans) for name, scans in lists.items()}, views, max(off_px))


def cameras(scene: Scene, members: Int[np.ndarray, " k"], scan: str) -> dict[str, Float[np.ndarray, "4 4"]]:
    """Return `world_mat_i` and `scale_mat_i` of a group's views; raises InputError if their bounds do not fit the loader's."""
    middle, farthest = _extent(scene, members)
    scale = farthest / _FARTHEST
    near = float(scene.near_far[members, 0].min())
    if near / scale < NEAR:
        raise InputError(
            f"scan {scan}: near {near:.4g} and far {farthest:.4g} do not both fit between {NEAR:g} and {FAR:g}",
            "leave out views that show the horizon, then pack the scene again",
        )
    scale_mat = np.diag([scale, scale, scale, 1.0])
    scale_mat[:3, 3] = middle
    found = {}
    for number, view in enumerate(members):
        fx, fy, cx, cy = scene.intrinsics[view]
        k = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])
        found[f"world_mat_{number}"] = homogeneous(k @ invert(scene.world_from_cam[view][:3]))
        found[f"scale_mat_{number}"] = scale_mat
    return found


def _write_scan(scene: Scene, members: Int[np.ndarray, " k"], folder: Path, scan: str) -> None:
    found = cameras(scene, members, scan)
    (folder / "image").mkdir(parents=True)
    for number, view in enumerate(members):
        Image.fromarray(scene.images[view]).save(folder / "image" / image_name(number))
    np.savez(folder / "cameras.npz", **found)


def _extent(scene: Scene, members: Int[np.ndarray, " k"]) -> tuple[Float[np.ndarray, " 3"], float]:
    """Return the centre of the views' slabs, and the largest distance to a far bound along a unit direction."""
    middles, farthest = [], 0.0
    for view in members:
        origins, directions = edge_rays(
            scene.world_from_cam[view], scene.intrinsics[view], scene.width_px, scene.height_px
        )
        near, far = scene.near_far[view]
        middles.append((origins + (near + far) / 2 * directions).mean(axis=0))
        farthest = max(farthest, float(far * np.linalg.norm(directions, axis=1).max()))
    return np.mean(middles, axis=0), farthest
