"""Similarity and grouping at the size of a city: 10,000 photographs with 10 million observations."""

from __future__ import annotations

import resource
import time

import numpy as np

from aug3d_core.bench.big_scene import big_scene
from aug3d_core.bench.figure import Figure, at_most, in_own_process
from aug3d_core.geometry.shared_points import look_positions, shared_points, visibility
from aug3d_core.groups.config import GROUPING_PRESETS
from aug3d_core.groups.methods import METHODS
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say

PHOTOS, OBSERVATIONS = 10_000, 10_000_000
_KIB_PER_MIB = 1024


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return seconds and memory of the similarity matrix, and the seconds of each way of grouping.

    They are processor seconds: the work keeps one core busy, so it takes as long on a machine with nothing else to do.
    The groups are as many and as large as in the preset `paper`. Each runs in a process of its own, so that the peak of
    memory is its own; that of the similarity counts the tracks that it works on too.
    """
    say("similarity", 0, 1, f"{PHOTOS} photographs")
    seconds, peak_mib = in_own_process(similarity_cost)
    found = {
        "similarity_seconds_10k": at_most(10.0, seconds, "s"),
        "similarity_peak_mib_10k": at_most(4096.0, peak_mib, "MiB"),
    }
    say("grouping", 0, 1, f"{PHOTOS} photographs, {len(METHODS)} ways")
    each = in_own_process(grouping_seconds)
    ways = {f"grouping_seconds_10k_{method}": Figure(taken, "s") for method, taken in each.items()}
    return found | {"grouping_seconds_10k": at_most(60.0, max(each.values()), "s")} | ways


def similarity_cost(photos: int = PHOTOS, observations: int = OBSERVATIONS) -> tuple[float, float]:
    """Return the processor seconds that the similarity of a large scene takes, and the peak memory of this process (MiB)."""
    views, points, tracks = big_scene(photos, observations)
    start = time.process_time()
    shared_points(visibility(tracks, len(views), len(points.xyz)))
    seconds = time.process_time() - start
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB_PER_MIB


def grouping_seconds(photos: int = PHOTOS, observations: int = OBSERVATIONS) -> dict[str, float]:
    """Return the processor seconds that each way of grouping takes, what it alone needs of the scene (its ground) included."""
    views, points, tracks = big_scene(photos, observations)
    shared = shared_points(visibility(tracks, len(views), len(points.xyz)))
    look = look_positions(tracks, points.xyz, len(views))[0]
    config, seconds = GROUPING_PRESETS["paper"], {}
    for method, group in METHODS.items():
        scene = GroupingScene(views, shared, look, points.xyz)
        start = time.process_time()
        group(scene, np.arange(len(views)), 20, config.groups, config, np.random.default_rng(0))
        seconds[method] = time.process_time() - start
    return seconds
