"""Copy features and matches of known photographs from an earlier database, so that only what is new is computed.

A photograph is known by the digest of its working copy and mask, in which features are searched. The result is what computing
everything again would give: matches depend on their two photographs alone, and a geometry, found by seeded RANSAC, also on
the pair's order and its cameras. Where one of these changed, the matches are copied and the geometry is left to be found.
"""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap
from jaxtyping import Bool, Int

from aug3d_core.photos.files import image_name
from aug3d_core.sfm.features import image_ids
from aug3d_core.sfm.files import FEATURES
from aug3d_core.sfm.matching_table import read_matching_table

_EARLIER = "earlier.db"


@dataclass(frozen=True)
class Earlier:
    """A copy of an earlier database, and for each photograph of today the one it was there (-1: not there)."""

    database: Path
    was: Int[np.ndarray, " n"]

    @property
    def known(self) -> Bool[np.ndarray, " n"]:
        """Which photographs were there."""
        return self.was >= 0


def digests(photos: pd.DataFrame, images: Path, masks: Path) -> list[str]:
    """Return the SHA-256 of each photograph's working copy, followed by its mask where it has one."""
    names = (image_name(photo_id) for photo_id in photos["photo_id"])
    both = ((images / name, masks / name) for name in names)
    return [
        hashlib.sha256(b"".join(file.read_bytes() for file in files if file.exists())).hexdigest() for files in both
    ]


def best_earlier(image_sha256: list[str], folder: Path | None, scratch: Path) -> Earlier | None:
    """Return the earlier output that shares most photographs, the newest of equals; None if none shares any.

    Its database is copied into a scratch folder: to open it would write to it, and what is stored never changes.
    """
    best: Earlier | None = None
    for files in sorted(folder.iterdir()) if folder is not None and folder.exists() else []:
        table = read_matching_table(files)
        was_there = dict(zip(table["image_sha256"], table["photo_id"], strict=True))
        found = Earlier(files / FEATURES, np.array([was_there.get(digest, -1) for digest in image_sha256], int))
        if found.known.sum() > (0 if best is None else best.known.sum()):
            best = found
    return best and replace(best, database=Path(shutil.copy(best.database, scratch / _EARLIER)))


def copy_features(earlier: Earlier, database: Path) -> None:
    """Copy keypoints and descriptors of the known photographs, all at once; not twice."""
    with pycolmap.Database.open(earlier.database) as old, pycolmap.Database.open(database) as new:
        old_id, new_id = image_ids(old), image_ids(new)
        with pycolmap.DatabaseTransaction(new):
            for photo in np.flatnonzero(earlier.known):
                source, target = old_id[earlier.was[photo]], new_id[photo]
                if new.exists_descriptors(target):
                    continue
                new.write_keypoints(target, old.read_keypoints(source))
                new.write_descriptors(target, old.read_descriptors(source))


def copy_matches(earlier: Earlier, pairs: Int[np.ndarray, "m 2"], database: Path) -> Bool[np.ndarray, " m"]:
    """Copy what is known of the pairs, failed ones too, not twice; return for which nothing is left to do."""
    done = np.zeros(len(pairs), bool)
    with pycolmap.Database.open(earlier.database) as old, pycolmap.Database.open(database) as new:
        old_id, new_id = image_ids(old), image_ids(new)
        same = {
            photo: _camera(old, old_id[earlier.was[photo]]) == _camera(new, new_id[photo])
            for photo in np.flatnonzero(earlier.known)
        }
        with pycolmap.DatabaseTransaction(new):
            for at in np.flatnonzero(earlier.known[pairs].all(axis=1)):
                one, two = sorted(pairs[at], key=lambda photo: new_id[photo])
                sources, targets = [old_id[earlier.was[photo]] for photo in (one, two)], (new_id[one], new_id[two])
                if sources[0] == sources[1] or not old.exists_two_view_geometry(*sources):
                    continue
                turned = sources[0] > sources[1]
                if not new.exists_matches(*targets):
                    matches = old.read_matches(*sources)
                    new.write_matches(*targets, matches[np.argsort(matches[:, 0])] if turned else matches)
                done[at] = not turned and same[one] and same[two]
                if done[at] and not new.exists_two_view_geometry(*targets):
                    new.write_two_view_geometry(*targets, old.read_two_view_geometry(*sources))
    return done


def _camera(database: pycolmap.Database, image_id: int) -> tuple:
    camera = database.read_camera(database.read_image(image_id).camera_id)
    return camera.model, camera.width, camera.height, tuple(camera.params), camera.has_prior_focal_length
