"""One row per photograph: how many features it has, and with how many others it shows the same thing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.photos.files import image_name
from aug3d_core.sfm.files import MATCHING_TABLE


def matching_table(photos: pd.DataFrame, image_sha256: list[str], database: Path) -> pd.DataFrame:
    """Return `photo_id`, `sha256`, `features`, `tried_pairs` (compared), `matched_pairs` (verified) and `image_sha256`.

    `sha256` is that of the user's file, `image_sha256` that of the working copy and its mask.
    """
    with pycolmap.Database.open(database) as opened:
        image_id = {image.name: image.image_id for image in opened.read_all_images()}
        ids = [image_id[image_name(photo_id)] for photo_id in photos["photo_id"]]
        features = [opened.num_keypoints_for_image(i) for i in ids]
        pair_ids, inliers = opened.read_two_view_geometry_num_inliers()
    row = {i: at for at, i in enumerate(ids)}
    pairs = np.array([[row[i] for i in pycolmap.pair_id_to_image_pair(pair)] for pair in pair_ids], int).reshape(-1, 2)
    holds = np.array(inliers, int) > 0  # a pair that was compared in vain is listed too, without inliers
    return pd.DataFrame(
        {
            "photo_id": photos["photo_id"].to_numpy(),
            "sha256": photos["sha256"].to_numpy(),
            "image_sha256": image_sha256,
            "features": np.array(features, int),
            "tried_pairs": np.bincount(pairs.ravel(), minlength=len(ids)),
            "matched_pairs": np.bincount(pairs[holds].ravel(), minlength=len(ids)),
        }
    )


def read_matching_table(folder: Path) -> pd.DataFrame:
    """Read the table from the matching stage's output."""
    return pd.read_parquet(folder / MATCHING_TABLE)
