"""A first look at photographs: how fast it is, how right its heights are, and whether it finds what was spoiled on purpose."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.bench.figure import Figure, at_least, at_most, in_own_process
from aug3d_core.bench.spoiled import SPOILED, recalled, spoil
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views
from aug3d_core.look.findings import findings_of
from aug3d_core.look.survey import Survey, survey_of
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_MESH, TRUTH_POSES

SEEDS = (7, 11, 23)
PHOTOS, SIZE_PX, NOISE, QUALITY = 120, (5184, 3888), 5.0, 92  # 20 megapixels, about 5 MB each
_COARSE = 8  # px of the pictures for each ray


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Look at three towns as they were flown, at the same with a few photographs spoiled, and at 120 large photographs."""
    off, alarms, found, names = [], 0, 0, 0
    folder = store.root / "photos"
    for seed in SEEDS:
        trial = run_trial(store, "town", scene, (f"town.seed={seed}",), directly(store, say))
        if trial.failure:
            return {"look": Figure(None, "", None, None, trial.failure)}
        town = store.files_dir(trial.records["town"])
        photos = sorted((town / TOWN_PHOTOS).iterdir())
        survey = survey_of(town / TOWN_PHOTOS, _silent)
        alarms += len(findings_of(survey))
        off.append(_height_error(survey, town))
        spoil(photos, folder)
        right, wrong = recalled(survey_of(folder, _silent), [photo.name for photo in photos])
        found, names, alarms = found + right, names + sum(map(len, SPOILED.values())), alarms + wrong
    _enlarge(photos, folder, say)
    seconds = in_own_process(partial(_seconds, folder))
    shutil.rmtree(folder)
    return {
        "look_height_error": Figure(float(np.median(np.abs(off))), "share"),
        "look_height_error_max": at_most(0.1, float(np.abs(off).max()), "share"),
        "look_spoiled_found_share": at_least(1.0, found / names, "share"),
        "look_false_alarms": at_most(0.0, float(alarms), "findings"),
        "look_seconds_120_photos_20_megapixels": at_most(30.0, seconds, "s"),
    }


def _silent(*_: object) -> None:
    pass


def _height_error(survey: Survey, town: Path) -> float:
    """Return by how much the median height is wrong, as a share: the truth is what cameras see of the town below them."""
    mesh, views = Mesh.load(town / TRUTH_MESH), Views.load(town / TRUTH_POSES)
    caster = Raycaster(mesh.xyz, mesh.triangles)
    depths = [
        np.median(caster.view(pose, intrinsics / _COARSE, size // _COARSE).distance)
        for pose, intrinsics, size in zip(views.cam_from_world, views.intrinsics, views.size, strict=True)
    ]
    assert survey.ground is not None
    return float(np.median(survey.ground.height_m) / np.median(depths) - 1)


def _enlarge(photos: Sequence[Path], folder: Path, say: Say) -> None:
    """Write photographs as large as a camera's, with noise, so that they take as long to decode."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    noise = np.random.default_rng(0).normal(0, NOISE, (SIZE_PX[1], SIZE_PX[0], 3)).astype(np.float32)
    for i in range(PHOTOS):
        photo = photos[i % len(photos)]
        with Image.open(photo) as image:
            exif, large = image.getexif(), np.asarray(image.convert("RGB").resize(SIZE_PX), np.float32)
        noisy = (large + np.roll(noise, 97 * i, axis=0)).clip(0, 255).astype(np.uint8)
        Image.fromarray(noisy).save(folder / f"{i:03d}.jpg", exif=exif, quality=QUALITY)
        say("look", i + 1, PHOTOS, "large photographs written")


def _seconds(folder: Path) -> float:
    started = time.monotonic()
    findings_of(survey_of(folder, _silent))
    return time.monotonic() - started
