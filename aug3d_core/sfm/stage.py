"""The sfm stage: photo table and matches -> posed views, points and tracks in the world."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.geometry.transforms import centres
from aug3d_core.photos.files import PHOTO_IMAGES, read_control_marks, read_photos
from aug3d_core.run.files import EARLIER
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress
from aug3d_core.sfm import export
from aug3d_core.sfm.camera_falloffs import measure_falloffs
from aug3d_core.sfm.camera_model import Chosen, adjusted_as_it_was, choose_camera_model, chosen_before
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.control import surveyed
from aug3d_core.sfm.decisions import sfm_decisions
from aug3d_core.sfm.files import FEATURES, SFM_MAP, UNPLACED
from aug3d_core.sfm.grow import Earlier, find_earlier
from aug3d_core.sfm.hold import Held, hold, why_all_move
from aug3d_core.sfm.joint import Joint, weakest_joint
from aug3d_core.sfm.mapping import Mapped, reconstruct
from aug3d_core.sfm.matching_table import read_matching_table
from aug3d_core.sfm.refusal import nothing_found, refuse_one_spot, refuse_short_baseline
from aug3d_core.sfm.rolling_shutter import measure_rolling_shutter, shutter_metrics, shutter_notes
from aug3d_core.sfm.unplaced import unplaced_notes, unplaced_table
from aug3d_core.sfm.write import (
    Located,
    align_model,
    alignment_notes,
    flight_doming,
    lens_notes,
    model_metrics,
    write_outputs,
)

MAPPING = "mapping"  # while the stage works
_LEAST_PLACED = 0.8
# Below either, lens and poses hold each other up: five photographs had poses off by 4 degrees, six by 0.7, eight by 0.2; 50
# and 16 points in a photograph (the median) by 4 and 41, 125 by 0.7 (`aug3d study stability --only overlap`)
_FEW_PLACED, _FEW_POINTS = 8, 100
# A hinge: halves of a town over a gap that few photographs look across, or joined by a thing that stands in both, are turned by
# 0.3 to 26 degrees at 0.07 to 0.28 (`--only islands`); towns have 0.7 and more, ochota 0.5, brighton 0.9
_LEAST_JOINT = 0.3
_SPOT_NOTE = (
    "the camera may have turned on one spot rather than flown: without its focal length, or GPS, the photographs do not "
    "tell, and the reconstruction may be wrong altogether"
)


@dataclass(frozen=True)
class _Mapping:
    """The models that mapping found.

    earlier: the model of the scene before it grew. held: that one with what is new, where its poses stay. poses_reason: why
    they stay or do not; None without an earlier model.
    """

    mapped: Mapped
    earlier: Earlier | None
    held: Held | None
    poses_reason: str | None
    may_be_one_spot: bool


def run(inputs: Inputs, config: SfmConfig, out: Path, progress: Progress) -> Outcome:
    """Reconstruct the photographs and write the largest model; the others are kept beside it.

    A killed try is gone on with where its last segment of mapping ended.
    """
    pycolmap.logging.minloglevel = 1  # warnings only: mapping writes dozens of lines per photograph
    photos, images = read_photos(inputs["photos"]), inputs["photos"] / PHOTO_IMAGES
    matching, marks = read_matching_table(inputs["matching"]), read_control_marks(inputs["photos"])
    found = _map(inputs, photos, marks, config, out / MAPPING, progress)
    mapped, earlier, held = found.mapped, found.earlier, found.held
    if not mapped.models:
        raise nothing_found(matching)
    progress(len(photos), len(photos), "photographs placed; adjusting them, and writing them undistorted")
    chosen, located, arrays = _placed(found, photos, marks, config.seed)
    falloffs = measure_falloffs(chosen.model, images, earlier.known_falloffs if earlier else {})
    known = earlier.images_as_they_are(chosen.model, falloffs) if earlier else {}
    settled = earlier.settled if earlier and held else None
    write_outputs(chosen.model, arrays, mapped.models[1:], located, photos, images, out, falloffs, known, settled)
    shutil.rmtree(out / MAPPING, ignore_errors=True)
    _refuse_short_baseline(arrays)
    unplaced = unplaced_table(photos, matching, _components(chosen.model, mapped), images)
    unplaced.to_parquet(out / UNPLACED)
    doming = flight_doming(arrays, located, photos)
    shutter = measure_rolling_shutter(arrays.views, arrays.points, arrays.tracks, photos)
    joint = weakest_joint(arrays.tracks, len(arrays.views))
    metrics = (
        model_metrics(chosen.model, arrays, located, photos, doming, falloffs)
        | _choices(mapped, chosen)
        | shutter_metrics(shutter)
        | _growth(found)
        | {"weakest_joint_points": joint and joint.points, "weakest_joint_share": joint and joint.share}
    )
    few = len(arrays.views) < _LEAST_PLACED * len(photos)
    bent = doming is not None and doming.flagged
    doubts = [*_doubts(arrays, joint), *shutter_notes(shutter)]
    if found.may_be_one_spot and not chosen.focal_known and not located.alignment.metric:
        doubts.append(_SPOT_NOTE)
    return Outcome(
        metrics=metrics,
        state="degraded" if few or doubts or located.problem or bent else "ok",
        notes=(
            *unplaced_notes(unplaced, len(photos)),
            *alignment_notes(located),
            *lens_notes(chosen.model, photos),
            *(doming.notes if doming else ()),
            *doubts,
            *(() if mapped.mapper == "incremental" else (f"mapped by the {mapped.mapper} mapper: {mapped.reason}",)),
        ),
        pictures={"Points and cameras from above": SFM_MAP},
        decisions=tuple(sfm_decisions(metrics)),
    )


def _map(
    inputs: Inputs,
    photos: pd.DataFrame,
    marks: pd.DataFrame | None,
    config: SfmConfig,
    folder: Path,
    progress: Progress,
) -> _Mapping:
    """Map about the earlier poses where there are some that may stay, else all photographs together."""
    images = inputs["photos"] / PHOTO_IMAGES
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as scratch:  # a killed try's goes with the rest of it
        database = Path(shutil.copy(inputs["matching"] / FEATURES, scratch))  # opening it may write to it
        may_be_one_spot = refuse_one_spot(database)
        earlier = find_earlier(photos, database, inputs.get(EARLIER))
        reason = None
        if earlier:
            told = surveyed(earlier.model, marks)
            reason = why_all_move(earlier, len(photos), bool(told and told.world_from_model))
            if not reason:
                start = folder / "still"
                mapped = reconstruct(images, database, photos, config, start, progress, earlier.model, still=True)
                if mapped.models:
                    held, reason = hold(mapped.models[0], earlier, photos, marks, config.seed)
                    if held:
                        return _Mapping(mapped, earlier, held, reason, may_be_one_spot)
        mapped = reconstruct(images, database, photos, config, folder, progress, earlier and earlier.model)
    return _Mapping(mapped, earlier, None, reason, may_be_one_spot)


def _placed(
    found: _Mapping, photos: pd.DataFrame, marks: pd.DataFrame | None, seed: int
) -> tuple[Chosen, Located, export.Arrays]:
    """Return the largest model with its cameras, how it lies in the world, and what it holds there."""
    if found.held:
        return chosen_before(found.held.model, photos), found.held.located, found.held.arrays
    largest = found.mapped.models[0]
    chosen = (
        chosen_before(adjusted_as_it_was(largest), photos) if found.earlier else choose_camera_model(largest, photos)
    )
    located, arrays = align_model(chosen.model, photos, marks, np.random.default_rng(seed), chosen)
    return chosen, located, arrays


def _growth(found: _Mapping) -> dict[str, Metric]:
    was = len(found.earlier.was) if found.earlier else 0
    return {
        "components": len(found.mapped.models),
        "grown_from": was,
        "poses_kept": was if found.held else 0,
        "poses_reason": found.poses_reason,
    }


def _doubts(arrays: export.Arrays, joint: Joint | None) -> list[str]:
    """Say what may have led poses astray though everything fits."""
    doubts, placed = [], len(arrays.views)
    seen = float(np.median(np.bincount(arrays.tracks.view, minlength=placed)))
    if placed < _FEW_PLACED or seen < _FEW_POINTS:
        doubts.append(
            f"{placed} photographs that see {seen:.0f} points hold the lens and each other loosely (wanted: {_FEW_PLACED} and "
            f"{_FEW_POINTS}): poses may be off by degrees; more photographs, more overlap, or sharper ones would hold them"
        )
    if joint is not None and joint.share < _LEAST_JOINT:
        doubts.append(
            f"{joint.photos} photographs and the other {placed - joint.photos} are joined by {joint.points} points, "
            f"{100 * joint.share:.0f} % of what one photograph sees (wanted: {100 * _LEAST_JOINT:.0f} %): one part may be "
            "turned against the other; photographs that show both would hold them"
        )
    return doubts


def _components(model: pycolmap.Reconstruction, mapped: Mapped) -> list[list[int]]:
    return [[export.photo_id(image) for image in export.registered(each)] for each in (model, *mapped.models[1:])]


def _choices(mapped: Mapped, chosen: Chosen) -> dict[str, Metric]:
    heldout_px: dict[str, Metric] = {
        f"heldout_px_{name.lower()}_{focal_from}": error for (name, focal_from), error in chosen.heldout_px.items()
    }
    return {
        "mapper": mapped.mapper,
        "mapper_reason": mapped.reason,
        "focal_source": chosen.focal_from,
        "focal_exif_over_refined_error": chosen.exif_over_refined,
        "focal_moved_share": chosen.focal_moved_share,
    } | heldout_px


def _refuse_short_baseline(arrays: export.Arrays) -> None:
    at = centres(arrays.views.cam_from_world)
    depth = np.linalg.norm(arrays.points.xyz[arrays.tracks.point] - at[arrays.tracks.view], axis=1)
    refuse_short_baseline(at, float(np.median(depth)))
