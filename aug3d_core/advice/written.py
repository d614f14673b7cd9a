"""The files of an advice in one folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from aug3d_core.advice.mission import geojson, kml, listing, missions, waypoints
from aug3d_core.advice.plan import Plan
from aug3d_core.export.target_folder import filling
from aug3d_core.run.atomic_file import write_synced

PAGE, TABLE, GEOJSON, KML = "advice.html", "advice.csv", "advice.geojson", "advice.kml"


def write_advice(plan: Plan, scene: str, folder: Path, page: Callable[[Sequence[str]], str]) -> list[str]:
    """Write the page, the table, and with GPS the files for the field; return their names.

    page: makes the page from the names of the other files. Raises UsageError if the folder is not empty, DiskFull.
    """
    advised = plan.choice.advised
    points = None if plan.origin is None else waypoints(advised, plan.origin, plan.lowest_ground, plan.altitude)
    files = {TABLE: listing(advised, points).encode()}
    if points:
        files |= {GEOJSON: geojson(points, advised).encode(), KML: kml(points, f"Photographs to take: {scene}")}
        files |= dict(missions(points, plan.clear_height))
    files[PAGE] = page(list(files)).encode()
    with filling(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            write_synced(folder / name, content)
    return list(files)
