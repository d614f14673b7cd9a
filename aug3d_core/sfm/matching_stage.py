"""The matching stage: photo table -> database of features and verified matches."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.photos.files import PHOTO_IMAGES, PHOTO_MASKS, read_photos
from aug3d_core.run.files import EARLIER
from aug3d_core.run.stage import Inputs, Metric, Order, Outcome, Progress, from_elsewhere
from aug3d_core.sfm import features, reuse
from aug3d_core.sfm.config import MatchingConfig
from aug3d_core.sfm.decisions import matching_decisions
from aug3d_core.sfm.files import FEATURES, MATCHING_TABLE
from aug3d_core.sfm.look import LargestFeatures
from aug3d_core.sfm.matching_table import matching_table
from aug3d_core.sfm.pairs import Choice, choose_pairs

UNSORTED = "unsorted"  # while the stage works
_FEW_FEATURES = 100
_NAMED = 5
_WORTH_A_NOTE = 0.1  # of the photographs with a position


def run(inputs: Inputs, config: MatchingConfig, out: Path, progress: Progress) -> Outcome:
    """Extract features and match the pairs that are worth it, copying what is known from an earlier output.

    A killed try is gone on with: what it found is in its database.
    """
    found = _find(inputs, config, out, progress, list)
    photos, choice = found.photos, found.choice
    features.store_sorted(out / UNSORTED / FEATURES, out / FEATURES)
    shutil.rmtree(out / UNSORTED)
    table = matching_table(photos, found.image_sha256, out / FEATURES)
    table.to_parquet(out / MATCHING_TABLE)
    counts = table["features"].to_numpy(int)
    matched = table["matched_pairs"].to_numpy(int).sum() // 2
    metrics: dict[str, Metric] = {
        "photos": len(photos),
        "photos_reused": found.photos_reused,
        "features_median": float(np.median(counts)),
        "features_min": int(counts.min()),
        "pairs_possible": len(photos) * (len(photos) - 1) // 2,
        "pairs_tried": len(choice.pairs),
        "pairs_reused": found.pairs_reused,
        "pairs_matched": int(matched),
        "pairs_matched_share": float(matched) / len(choice.pairs),
        "pairs_by": choice.by,
        "photos_doubted_gps": len(choice.doubted),
        "pairs_ranked": found.pairs_ranked,
    }
    if not found.resumed:  # the record tells what all tries cost together
        metrics |= found.spent
    return Outcome(
        metrics=metrics,
        notes=_notes(photos, table, choice),
        decisions=tuple(matching_decisions(metrics)),
    )


def assist(inputs: Inputs, config: MatchingConfig, out: Path, progress: Progress) -> Outcome:
    """Find features, then matches, that nobody has found yet."""
    return Outcome(metrics={"pairs_tried": len(_find(inputs, config, out, progress, from_elsewhere).choice.pairs)})


@dataclass(frozen=True)
class _Found:
    """What is in the database, what was there before, and what the rest cost."""

    photos: pd.DataFrame
    image_sha256: list[str]
    choice: Choice
    resumed: bool
    photos_reused: int
    pairs_reused: int
    pairs_ranked: int
    spent: dict[str, Metric]


def _find(inputs: Inputs, config: MatchingConfig, out: Path, progress: Progress, ordered: Order) -> _Found:
    """Fill the database with features, and with matches of the pairs that are worth it."""
    pycolmap.logging.minloglevel = 1
    photos = read_photos(inputs["photos"])
    images, masks = inputs["photos"] / PHOTO_IMAGES, inputs["photos"] / PHOTO_MASKS
    image_sha256 = reuse.digests(photos, images, masks)
    clock = _Clock()
    (out / UNSORTED / features.SHARDS).mkdir(parents=True, exist_ok=True)
    database = out / UNSORTED / FEATURES
    resumed = features.make_database(photos, images, database)
    scratch = Path(
        tempfile.mkdtemp(dir=out / UNSORTED)
    )  # new: SQLite would read a killed try's log into another database
    earlier = reuse.best_earlier(image_sha256, inputs.get(EARLIER), scratch)
    reused = np.zeros(len(photos), bool)
    if earlier:
        reuse.copy_features(earlier, database)
        reused = earlier.known
    features.extract(photos, images, masks, database, config, progress, ordered)
    extract_seconds, _ = clock.lap()
    look = LargestFeatures(photos, database, config.seed, progress)
    choice = choose_pairs(photos, config, look)
    coarse_seconds, coarse_cpu_seconds = clock.lap()
    done = reuse.copy_matches(earlier, choice.pairs, database) if earlier else np.zeros(len(choice.pairs), bool)
    features.match(choice.pairs, database, config, progress, ordered)
    match_seconds, match_cpu_seconds = clock.lap()
    spent: dict[str, Metric] = {
        "extract_seconds": extract_seconds,
        "coarse_seconds": coarse_seconds,
        "match_seconds": coarse_seconds + match_seconds,
        "match_cpu_seconds": coarse_cpu_seconds + match_cpu_seconds,
    }
    return _Found(photos, image_sha256, choice, resumed, int(reused.sum()), int(done.sum()), look.ranked, spent)


class _Clock:
    """Wall and processor seconds between calls; the work runs in threads of this process, and in workers that have ended."""

    def __init__(self) -> None:
        self.last = time.monotonic(), sum(os.times()[:4])

    def lap(self) -> tuple[float, float]:
        (wall, cpu), self.last = self.last, (time.monotonic(), sum(os.times()[:4]))
        return round(self.last[0] - wall, 3), round(self.last[1] - cpu, 3)


def _notes(photos: pd.DataFrame, table: pd.DataFrame, choice: Choice) -> tuple[str, ...]:
    notes = []
    located = photos["lat_deg"].notna().to_numpy()
    doubted = int(located[choice.doubted].sum())
    if doubted > _WORTH_A_NOTE * located.sum():
        notes.append(
            f"{doubted} of {located.sum()} photographs do not look more like their neighbours by GPS than like others: "
            "a coarse comparison with all chose more pairs for them"
        )
    bare = photos["name"][(table["features"] < _FEW_FEATURES).to_numpy()].tolist()
    if bare:
        names = ", ".join(bare[:_NAMED]) + (", ..." if len(bare) > _NAMED else "")
        notes.append(
            f"{len(bare)} of {len(photos)} photographs have fewer than {_FEW_FEATURES} features "
            f"(no texture, or blurred): {names}"
        )
    return tuple(notes)
