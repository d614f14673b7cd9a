"""What a scene is for others: its groups for the original pixelNeRF code, its map, its mesh, its points."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import Any

from rich.console import Console

from aug3d_core.poses.recognise import CLOUD, GLB, MAP
from aug3d_core.store.scenes import object_of
from aug3d_core.store.store import Store

_SAME_CAMERA_PX = 0.5


def export_groups(dataset: Path, folder: Path, as_json: bool) -> None:
    """Write the groups in the DTU layout, and tell it."""
    from aug3d_core.export.dtu import export_dtu  # with zarr, which other commands do without

    written = export_dtu(dataset, folder)
    if as_json:
        print(json.dumps({"folder": str(folder), "format": "dtu", **asdict(written)}))
        return
    counts = ", ".join(f"{count} {name}" for name, count in written.scans.items())
    print(f"{counts} scans, a group each, with {written.views} views are in {folder}")
    if written.intrinsics_off_px > _SAME_CAMERA_PX:
        Console().print(
            f"[yellow]note[/] pixelNeRF takes one camera per scan: views are up to {written.intrinsics_off_px:.1f} px off",
            soft_wrap=True,
        )
    quoted = quote(str(folder))
    print(f"\nnext  python train/train.py -n my_scene -c conf/exp/dtu.conf -D {quoted} -V 3   (in pixelNeRF's folder)")
    print(f"      python eval/eval.py -n my_scene -c conf/exp/dtu.conf -D {quoted} --split test -P '1 2 3'")


def export_map(store: Store, version: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    """Write the map of a scene, and tell it."""
    from aug3d_core.export import maps  # with rasterio and open3d, which other commands do without

    sfm, surface, photos = _folders(store, version, maps.READ, "sfm", "surface", "photos")
    console = Console(stderr=True)
    with console.status("drawing the map ...") as status:
        written = maps.export_map(
            sfm, surface, photos, folder, lambda done, total: status.update(f"drawing the map: {done} of {total} rows")
        )
    if as_json:
        print(json.dumps({"folder": str(folder), "format": MAP, **asdict(written)}))
        return
    cameras = " and ".join((maps.CAMERAS, *((maps.CAMERAS_KML,) if written.crs else ())))
    size = f"{written.width_px:,} x {written.height_px:,} px of {written.pixel:g} {written.unit}"
    print(f"{maps.ORTHOPHOTO}, {maps.SURFACE_MODEL} ({size}, {written.covered:.0%} covered), {cameras} are in {folder}")
    if written.crs:
        by_gps = "the photographs' GPS: metres, without ground control points"
        print(f"reference system: {written.crs}. As true as {'the control points' if written.by_control else by_gps}")
        _tell_heights(written.heights_from_zero)
    else:
        Console().print(
            "[yellow]note[/] no GPS: the map has no reference system, and its unit is the scene's", soft_wrap=True
        )


def export_model(store: Store, version: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    """Write the mesh of a scene, and tell it."""
    from aug3d_core.export import glb  # with trimesh, which other commands do without

    sfm, surface = _folders(store, version, glb.READ, "sfm", "surface")
    written = glb.export_glb(sfm, surface, folder)
    if as_json:
        print(json.dumps({"folder": str(folder), "format": GLB, **asdict(written)}))
        return
    print(f"{glb.MODEL} ({written.triangles:,} triangles, {written.mib:.1f} MiB) and {glb.OFFSET} are in {folder}")


def export_points(store: Store, version: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    """Write the point cloud of a scene, and tell it."""
    from aug3d_core.export import points  # with laspy and rasterio, which other commands do without

    sfm, depth = _folders(store, version, points.READ, "sfm", "depth")
    written = points.export_points(sfm, depth, folder)
    if as_json:
        print(json.dumps({"folder": str(folder), "format": CLOUD, **asdict(written)}))
        return
    where = written.crs or f"the scene's own world, in {written.unit}s: no GPS"
    print(f"{written.points:,} points: {points.LAZ} ({where}) and {points.PLY} (the scene's world) are in {folder}")
    _tell_heights(bool(written.crs) and written.heights_from_zero)


def _tell_heights(from_zero: bool) -> None:
    if from_zero:
        Console().print(
            "[yellow]note[/] GPS told no altitudes: heights count from the world's zero, not from the sea",
            soft_wrap=True,
        )


def _folders(
    store: Store, version: Mapping[str, Any], reads: Mapping[str, Sequence[str]], *steps: str
) -> Iterator[Path]:
    """Return where the files of steps lie; only those that are read are brought here."""
    records = (object_of(store, version, step) for step in steps)
    return (store.files_dir(record, record.named(reads)) for record in records)
