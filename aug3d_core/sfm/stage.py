"""The sfm stage: photo table and matches -> posed views, points and tracks in the world."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.errors import InputError
from aug3d_core.photos.table import read_photos
from aug3d_core.sfm import export
from aug3d_core.sfm.align import Alignment
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.focal import settle_focal
from aug3d_core.sfm.mapping import SMALLEST_MODEL, reconstruct
from aug3d_core.sfm.write import align_model, alignment_notes, model_metrics, write_outputs
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout


def run(inputs: Inputs, config: SfmConfig, out: Path, progress: Progress) -> Outcome:
    """Reconstruct the photographs and write the largest model; the others are kept beside it."""
    pycolmap.logging.minloglevel = 1  # warnings only: mapping writes dozens of lines per photograph
    photos, images = read_photos(inputs["photos"]), inputs["photos"] / layout.PHOTO_IMAGES
    with tempfile.TemporaryDirectory(dir=out) as scratch:
        database = Path(shutil.copy(inputs["matching"] / layout.FEATURES, scratch))  # opening it may write to it
        models = reconstruct(images, database, len(photos), config, progress)
    if not models:
        raise _nothing_found(len(photos))
    progress(len(photos), len(photos), "photographs placed; writing them undistorted")
    settled = settle_focal(models[0], photos)
    model = settled.model
    alignment = align_model(model, photos, np.random.default_rng(config.seed))
    arrays = write_outputs(model, models[1:], alignment, photos, images, out)
    metrics = model_metrics(model, arrays, alignment, photos) | {
        "components": len(models),
        "focal_source": settled.source,
        "focal_exif_over_refined_error": settled.exif_over_refined,
    }
    notes = _notes(model, models, alignment, photos)
    return Outcome(
        metrics=metrics,
        state="degraded" if len(arrays.views) < 0.5 * len(photos) or alignment.problem else "ok",
        notes=notes,
        pictures={"Points and cameras from above": layout.SFM_MAP},
    )


def _notes(
    model: pycolmap.Reconstruction, models: list[pycolmap.Reconstruction], alignment: Alignment, photos: pd.DataFrame
) -> tuple[str, ...]:
    notes = []
    placed = {export.photo_id(image) for image in export.registered(model)}
    lost = [name for photo, name in zip(photos["photo_id"], photos["name"], strict=True) if photo not in placed]
    if lost:
        names = ", ".join(lost[:5]) + (", ..." if len(lost) > 5 else "")
        notes.append(f"{len(lost)} of {len(photos)} photographs could not be placed: {names}")
    if len(models) > 1:
        sizes = ", ".join(str(other.num_reg_images()) for other in models[1:])
        notes.append(f"the photographs fall into {len(models)} parts; the largest is used, the others hold {sizes}")
    return (*notes, *alignment_notes(alignment))


def _nothing_found(photos: int) -> InputError:
    return InputError(
        f"no scene could be reconstructed: no {SMALLEST_MODEL} of the {photos} photographs hold together",
        "Use photographs of one scene in which neighbours overlap by 60 % or more, sharp and with texture.",
    )
