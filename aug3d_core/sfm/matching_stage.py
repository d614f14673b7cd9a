"""The matching stage: photo table -> database of features and verified matches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap

from aug3d_core.photos.table import read_photos
from aug3d_core.sfm import features
from aug3d_core.sfm.config import MatchingConfig
from aug3d_core.sfm.matching_table import matching_table
from aug3d_core.sfm.pairs import choose_pairs
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout


def run(inputs: Inputs, config: MatchingConfig, out: Path, progress: Progress) -> Outcome:
    """Extract features and match the pairs that are worth it."""
    pycolmap.logging.minloglevel = 1
    photos, images = read_photos(inputs["photos"]), inputs["photos"] / layout.PHOTO_IMAGES
    pairs, chosen_by = choose_pairs(photos, config)
    database = out / layout.FEATURES
    features.make_database(photos, images, database)
    features.extract(photos, images, database, config, progress)
    matched = features.match(pairs, database, config, progress)
    table = matching_table(photos, database)
    table.to_parquet(out / layout.MATCHING_TABLE)
    return Outcome(
        metrics={
            "photos": len(photos),
            "pairs_tried": len(pairs),
            "pairs_matched": matched,
            "pairs_matched_share": matched / len(pairs),
            "pairs_by": chosen_by,
            "pairs_possible": len(photos) * (len(photos) - 1) // 2,
            "features_median": float(np.median(table["features"])),
        }
    )
