"""A run of a little flight over level ground, made up file by file: what its report must say is known exactly.

Twelve photographs in two strips look straight down from 60 m, each on 60 by 40 m. One has a name that is HTML. GPS is off
by 3 m east and 4 m north. Five points lie in every photograph that sees them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from aug3d_core.factory.auto.rows import needs_of
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.metrics.scene_metrics import scene_metrics
from aug3d_core.photos.files import PHOTO_TABLE, REJECTED_TABLE
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS, TRACKS, UNPLACED, VIEWS, WORLD
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.record import Record

EVIL = "<script>alert(1)</script>.jpg"
GPS_ERROR_M = (3.0, 4.0)
_ORIGIN = np.array([46.9, 7.5, 540.0])
_K = Decision(field="grouping.k", value=3, measured="6 training photographs", rule="because")
_OF_SFM = (
    Decision(field="sfm.mapper", value="incremental", measured="", rule="few"),
    Decision(field="sfm.camera_model", value="RADIAL", measured="RADIAL 0.25 px", rule="the simplest"),
)
_ROLES = ["train"] * 6 + ["gap"] * 2 + ["support"] * 2 + ["target"] * 2


def record(stage: str, **changes: Any) -> Record:
    values = {
        "stage": stage, "key": "k" * 64, "digest": "d" * 64, "recipe": "r" * 64, "config": {"seed": 3}, "inputs": {},
        "versions": {"bpy": "5.0.1"},
        "files": {}, "metrics": {"vertices": 12345}, "state": "ok", "notes": (), "series": {}, "pictures": {},
        "seconds": 12.5, "peak_mib": 900.0,
    }  # fmt: skip
    return Record(**(values | changes))


def run_of(made: list[tuple[Step, Record, Path]], **metrics: Any) -> ReportedRun:
    needs = needs_of(made, {})
    return ReportedRun(made, scene_metrics("s", "tiny", "abc", 1.0, made) | {"needs": needs} | metrics)


def flight() -> Views:
    """Twelve photographs 20 m apart along x, in strips 30 m apart."""
    at = np.array([(20.0 * i, 30.0 * strip, 60.0) for strip in (0, 1) for i in range(6)])
    poses = np.stack([look_at(place, place * [1, 1, 0]) for place in at])
    count = len(at)
    return Views(
        photo_id=np.arange(count) + 100,
        cam_from_world=poses,
        intrinsics=np.tile([600.0, 600.0, 300.0, 200.0], (count, 1)),
        size=np.tile([600, 400], (count, 1)),
    )


def flown(root: Path) -> ReportedRun:
    """Return the run, with its files under a folder."""
    views = flight()
    photos, sfm, grouping = (_folder(root, name) for name in ("photos", "sfm", "grouping"))
    _photos(views, photos)
    views.save(sfm / VIEWS)
    xyz = np.random.default_rng(0).uniform([-40, -30, 0], [140, 60, 0.001], (4000, 3))
    Points(xyz=xyz, rgb=np.full((len(xyz), 3), 99, np.uint8), error_px=np.linspace(0, 1, len(xyz))).save(sfm / POINTS)
    point, view = np.nonzero(np.ones((len(xyz), 3)))
    Tracks(point=point, view=view, xy=np.zeros((len(point), 2))).save(sfm / TRACKS)
    origin = dict(zip(("lat_deg", "lon_deg", "alt_m"), _ORIGIN.tolist(), strict=True))
    (sfm / WORLD).write_text(json.dumps({"metric": True, "unit": "m", "up_from": "gps", "origin": origin}))
    unplaced = {"photo_id": 7, "name": f"{EVIL}2", "reason": "too blurred", "features": 40, "matched_pairs": 1}
    pd.DataFrame([unplaced]).to_parquet(sfm / UNPLACED)
    _split(grouping)
    placed = {"photos": 13, "registered": 12, "points": 4000, "observations": 12000, "reprojection_px": 0.5,
              "registered_share": 12 / 13, "gps_residual_m_median": 5.0, "mapper": "incremental", "mapper_reason": "few",
              "camera_model": "RADIAL", "focal_source": "exif", "heldout_px_radial_exif": 0.25}  # fmt: skip
    return run_of([
        (Step(STAGES["photos"]), record("photos", metrics={"photos": 13, "rejected": 1}), photos),
        (Step(STAGES["sfm"]), record("sfm", metrics=placed, decisions=_OF_SFM), sfm),
        (Step(STAGES["grouping"]), record("grouping", metrics={"groups": 3, "k": 3}, decisions=(_K,)), grouping),
    ])  # fmt: skip


def _folder(root: Path, name: str) -> Path:
    (root / name).mkdir()
    return root / name


def _photos(views: Views, folder: Path) -> None:
    gps = centres(views.cam_from_world) - [*GPS_ERROR_M, 0]
    table = pd.DataFrame(geodetic_from_enu(gps, _ORIGIN), columns=["lat_deg", "lon_deg", "alt_m"])
    names = [EVIL, *(f"p{i}.jpg" for i in range(1, len(views)))]
    table.assign(photo_id=views.photo_id, name=names).to_parquet(folder / PHOTO_TABLE)
    refused = {"torn.jpg": "unreadable", "hover.jpg": "redundant: shows what p3.jpg shows, 0.1% of its width aside"}
    pd.DataFrame(refused.items(), columns=["name", "reason"]).to_parquet(folder / REJECTED_TABLE)


def _split(folder: Path) -> None:
    table = pd.DataFrame({"view": range(12), "role": _ROLES, "look_x": 0.0, "look_y": 0.0})
    table.to_parquet(folder / SPLIT_TABLE)
    np.savez(folder / GROUPS, members=np.array([[0, 1, 2], [3, 4, 5], [1, 2, 3]]))


def picture_file(path: Path, size: tuple[int, int] = (70, 110)) -> None:
    Image.new("RGB", size, (200, 30, 30)).save(path)
