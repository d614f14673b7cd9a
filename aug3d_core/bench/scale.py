"""How each stage grows with the number of photographs: towns of one kind, ever larger, flown at one height."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, at_most, in_own_process, told
from aug3d_core.factory.estimate.calibration import calibration_by, samples_of_records
from aug3d_core.factory.estimate.estimate import estimate_of
from aug3d_core.factory.estimate.size import size_of
from aug3d_core.factory.material import Material
from aug3d_core.geometry.shared_points import shared_points, visibility
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import read_photos
from aug3d_core.sfm.config import MATCHING_PRESETS, MatchingConfig
from aug3d_core.sfm.files import FEATURES, POINTS, TRACKS, VIEWS
from aug3d_core.sfm.pairs import choose_pairs
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.town.drone.flight import plan_flight

# Small photographs, soon made; how a stage grows does not depend on their size
SETTINGS = (
    "town.width_px=320",
    "town.samples=3",
    "depth.max_px=320",
    "grouping.folds=1",
    "evaluation.flythrough_frames=0",
)
PHOTOS, LENGTH_M, WIDTH_M = 60, 220.0, 130.0  # of the preset's own town
MOST, MOST_MATCHING = 2.2, 2.5  # times the processor time for twice the photographs
SEEN_TOGETHER = 50  # points
_ROUNDS = 4  # a larger flight has less of an edge
NEIGHBOURS = 32  # that a photograph looks most like: as most are each other's, they come to some 18 pairs a photograph
PAIRS = 20.0


def figures(store: Store, scene: Measured, say: Say, sizes: Sequence[int]) -> dict[str, Figure]:
    """Make towns of ever more photographs, and compare the processor time of each stage from one size to the next."""
    trials: dict[int, Trial] = {}
    estimated: dict[int, float] = {}
    for size in sorted(sizes):
        town = town_of(scene, size)
        expected = _expected(town, trials)
        trial = run_trial(store, "evaluation", town, (), directly(store, say))
        if trial.failure:
            return {f"photos_{size}": Figure(None, "", None, None, trial.failure)}
        count = int(trial.records["photos"].metrics["photos"] or 0)
        trials[count], estimated[count] = trial, sum(expected[stage] for stage in _seconds(trial))
    largest = trials[max(trials)]
    return {
        **growth({count: _seconds(trial) for count, trial in trials.items()}),
        "photos_largest": Figure(max(trials), "photographs"),
        "peak_mib_largest": at_most(8192.0, largest.peak_mib(list(largest.records)), "MiB"),
        **{f"processor_seconds_{count}": Figure(sum(_seconds(trial).values()), "s") for count, trial in trials.items()},
        **{f"peak_mib_{count}": Figure(trial.peak_mib(list(trial.records)), "MiB") for count, trial in trials.items()},
        **_estimates(trials, estimated),
        **_accuracy(trials),
        **in_own_process(partial(recall_unordered, *_of(store, largest))),
    }


def town_of(scene: Measured, photos: int) -> Measured:
    """Return settings of a town that is flown in about so many photographs: larger, not more densely photographed."""
    times = math.sqrt(photos / PHOTOS)
    for _ in range(_ROUNDS):
        area = (f"town.length_m={LENGTH_M * times:.0f}", f"town.width_m={WIDTH_M * times:.0f}")
        found = Measured(scene.preset, (*SETTINGS, *area, *scene.overrides))
        times *= math.sqrt(photos / len(plan_flight(found.config().town, np.random.default_rng(0))))
    return found


def growth(seconds: Mapping[int, Mapping[str, float]]) -> dict[str, Figure]:
    """Return how many times the processor time of each stage rises for twice the photographs, where it rises most.

    seconds: of each stage, by the number of photographs.
    """
    found = {}
    for stage in seconds[min(seconds)]:
        rises = [
            (seconds[many][stage] / seconds[few][stage]) ** (1 / math.log2(many / few))
            for few, many in pairwise(sorted(seconds))
        ]
        most = MOST_MATCHING if stage == "matching" else MOST
        found[f"growth_{stage}"] = at_most(most, max(rises, default=None), "times for twice")
    return found


def recall_unordered(photos: Path, matching: Path, sfm: Path) -> dict[str, Figure]:
    """Choose pairs as if no photograph had GPS, and return the share found of those that see points together."""
    from aug3d_core.sfm.look import LargestFeatures

    table = read_photos(photos).assign(lat_deg=np.nan, lon_deg=np.nan, alt_m=np.nan)
    config = MatchingConfig(**MATCHING_PRESETS["tiny"].model_dump() | {"pairs": "coarse", "neighbours": NEIGHBOURS})
    with tempfile.TemporaryDirectory() as scratch:
        database = Path(shutil.copy(matching / FEATURES, scratch))  # to open it writes to it, and the store's must stay
        look = LargestFeatures(table, database, config.seed, lambda *_: None)
        chosen = choose_pairs(table, config, look).pairs
    views, tracks = Views.load(sfm / VIEWS), Tracks.load(sfm / TRACKS)
    shared = shared_points(visibility(tracks, len(views), len(Points.load(sfm / POINTS).xyz))).tocoo()
    together = (shared.data >= SEEN_TOGETHER) & (shared.row < shared.col)
    true = np.sort(
        np.stack([views.photo_id[shared.row[together]], views.photo_id[shared.col[together]]], axis=1), axis=1
    )
    recall = float(np.isin(_number(true, len(table)), _number(chosen, len(table))).mean())
    return {
        "pairs_recall_unordered": at_least(0.95, recall, "share"),
        "pairs_per_photo_unordered": at_most(PAIRS, len(chosen) / len(table), "pairs"),
        "pairs_ranked_share_unordered": Figure(2 * look.ranked / (len(table) * (len(table) - 1)), "share"),
    }


def _number(pairs: np.ndarray, count: int) -> np.ndarray:
    return pairs[:, 0] * count + pairs[:, 1]


def _seconds(trial: Trial) -> dict[str, float]:
    return {stage.name: trial.cpu_seconds([stage.name]) for stage in Material().stages() if trial.of([stage.name])}


def _of(store: Store, trial: Trial) -> tuple[Path, Path, Path]:
    photos, matching, sfm = (store.files_dir(trial.records[name]) for name in ("photos", "matching", "sfm"))
    return photos, matching, sfm


def _expected(town: Measured, trials: Mapping[int, Trial]) -> dict[str, float]:
    """Return what each stage is estimated to take, by what this machine took for the smaller towns, or by a little work [s]."""
    samples = [sample for trial in reversed(list(trials.values())) for sample in samples_of_records(trial.records)]
    size = size_of(Material(), town.config(), {})
    return {
        stage: cost.seconds.likely for stage, cost in estimate_of(town.config(), size, calibration_by(samples)).items()
    }


def _estimates(trials: Mapping[int, Trial], estimated: Mapping[int, float]) -> dict[str, Figure]:
    """Return the estimates over what was then measured, wall time, and the worst, whichever way it is wrong."""
    over = {count: estimated[count] / trial.seconds(_seconds(trial)) for count, trial in trials.items()}
    found = {f"estimated_over_measured_{count}": Figure(ratio, "ratio") for count, ratio in over.items()}
    worst = max(max(ratio, 1 / ratio) for ratio in over.values())
    return found | {"estimate_error_ratio": at_most(1.5, worst, "times")}


def _accuracy(trials: Mapping[int, Trial]) -> dict[str, Figure]:
    """Return how many photographs have a pose, and how many times as far the largest town's are off as the smallest's [m].

    A town's extent, of which errors are a share, is as the root of its photographs.
    """
    found = {
        f"registered_share_{count}": at_least(0.98, told(trial, "truth", "registered_share"), "share")
        for count, trial in trials.items()
    }
    errors = {count: told(trial, "truth", "position_error_pct") for count, trial in trials.items()}
    found |= {f"position_error_pct_{count}": Figure(error, "% of extent") for count, error in errors.items()}
    least, most = (errors[of(errors)] for of in (min, max))
    rise = most / least * math.sqrt(max(errors) / min(errors)) if least and most else None
    return found | {"position_error_growth": at_most(2.0, rise, "times")}
