"""Database -> reconstructions, the largest first.

All run in one thread: in several, sums are added in another order each time, and two runs over one town of 60 photographs
differed by a point and by up to 13 mm. One thread repeats to the bit and took no longer (24 s of processor time against
26 s): most of the time goes to the bookkeeping between adjustments.

Incremental mapping is the most careful, and for the town of 60 photographs also the fastest (22 s of processor time against
37 s of global mapping, with equal errors); its time grows faster than the number of photographs, and at 120 (`ochota`) global
mapping took 288 s against 320 s. Global mapping leans on focal lengths being known; where many are not, hierarchical mapping
keeps the careful method and cuts the scene into parts.
"""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from aug3d_core.run.stage import Progress
from aug3d_core.sfm import export
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.segments import Mapping, map_in_segments

SMALLEST_MODEL = 3
THREADS = 1

_MANY = 250  # photographs
_KNOWN_SHARE = 0.95  # of photographs with a focal length: a few without do not decide how all are mapped
# That position a photograph in global mapping, the longest first; all are triangulated afterwards. In five towns and `ochota`
# it takes 0.5 to 0.7 of the time of all tracks, with errors within 1 %; of 100, 0.4 of it, and 1.2 times the error
_TRACKS = 200
_PART = 100  # photographs in a part of hierarchical mapping
_SHARED = 25  # photographs that two parts have in common
# Points in common that hold two photographs, or two parts, together: what COLMAP itself asks of a pair, and of a photograph
# that is to be added to a model
_LINK_OF_TWO, _LINK_OF_PARTS = 15, 30


@dataclass(frozen=True)
class Mapped:
    """The reconstructions of at least 3 photographs, sorted by photographs, then points; what made them, and why that."""

    models: list[pycolmap.Reconstruction]
    mapper: str
    reason: str


def reconstruct(
    images: Path,
    database: Path,
    photos: pd.DataFrame,
    config: SfmConfig,
    folder: Path,
    progress: Progress,
    start: pycolmap.Reconstruction | None = None,
    still: bool = False,
) -> Mapped:
    """Map with the mapper that is asked for, or chosen; from `start`, a part of the scene, incrementally.

    folder: where a killed incremental mapping left its segments, and finds them. still: what is in `start` does not move.
    """
    mapper, reason = choose_mapper(config.mapper, len(photos), float(np.mean(photos["focal_px"].notna())))
    if start is not None:
        mapper, reason = "incremental", "the scene grows from an earlier output"
    if mapper == "incremental":
        total = len(photos)

        def on_placed(placed: int) -> None:
            progress(min(placed, total), total, "photographs placed")

        mapping = _one_by_one(images, database, config.seed, start, still, on_placed)
        models = map_in_segments(mapping, folder, start)
    else:
        with tempfile.TemporaryDirectory(dir=database.parent) as scratch:
            if mapper == "global":
                progress(0, len(photos), "photographs placed, all at once")
                found = pycolmap.global_mapping(database, images, scratch, _global_options(config.seed))
            else:
                progress(0, len(photos), "photographs placed, part by part")
                found = _hierarchical(images, database, scratch, config.seed)
            models = list(found.values())
    parts = [part for model in models for part in parts_of(model)]
    found = [model for model in parts if model.num_reg_images() >= SMALLEST_MODEL]
    return Mapped(sorted(found, key=lambda model: (-model.num_reg_images(), -model.num_points3D())), mapper, reason)


def parts_of(model: pycolmap.Reconstruction) -> list[pycolmap.Reconstruction]:
    """Return a model as the parts that points hold together.

    Global mapping puts islands into one model, each wherever it happens to be: 23 photographs of two halves of a town, 60 m
    apart, were "all placed", half of them on their sides.
    """
    images = export.registered(model)
    seen = [np.unique([point.point3D_id for point in image.get_observation_points2D()]) for image in images]
    points, row = np.unique(np.concatenate(seen), return_inverse=True)
    sees = sparse.csr_array(
        (np.ones(len(row), np.int64), (np.repeat(np.arange(len(images)), [*map(len, seen)]), row)),
        shape=(len(images), len(points)),
    )
    _, part = connected_components(sees @ sees.T >= _LINK_OF_TWO, directed=False)
    of_parts = sparse.csr_array((np.ones(len(part), np.int64), (part, np.arange(len(part))))) @ sees > 0
    shared = of_parts.astype(np.int64) @ of_parts.T.astype(np.int64)
    count, held = connected_components(shared >= _LINK_OF_PARTS, directed=False)
    if count == 1:
        return [model]
    return [_only(model, {images[at].frame_id for at in np.flatnonzero(held[part] == each)}) for each in range(count)]


def _only(model: pycolmap.Reconstruction, frames: set[int]) -> pycolmap.Reconstruction:
    part = copy.deepcopy(model)
    for frame in part.reg_frame_ids():
        if frame not in frames:
            part.deregister_frame(frame)
    return part


def choose_mapper(asked: str, photos: int, focal_known: float) -> tuple[str, str]:
    """Return incremental, global or hierarchical, and the reason. focal_known: share of photographs with a focal length."""
    if asked != "auto":
        return asked, "asked for"
    if photos <= _MANY:
        return "incremental", f"{photos} photographs: at most {_MANY} are mapped one by one"
    many = f"{photos} photographs, too many to map one by one"
    if focal_known >= _KNOWN_SHARE:
        return "global", f"{many}, and {focal_known:.0%} of known focal length"
    return "hierarchical", f"{many}, and only {focal_known:.0%} of known focal length"


def _one_by_one(
    images: Path,
    database: Path,
    seed: int,
    start: pycolmap.Reconstruction | None,
    still: bool,
    on_placed: Callable[[int], None],
) -> Mapping:
    options = _incremental_options(seed)
    options.fix_existing_frames = still
    if start is not None:
        options.constant_cameras = set(start.cameras)
    return Mapping(images, database, options, on_placed)


def _hierarchical(images: Path, database: Path, scratch: str, seed: int) -> dict[int, pycolmap.Reconstruction]:
    try:
        return pycolmap.hierarchical_mapping(database, images, scratch, _hierarchical_options(seed))
    except IndexError:  # how it tells that no part of the scene gave a model (pycolmap 4.2.1)
        return {}


def _incremental_options(seed: int) -> pycolmap.IncrementalPipelineOptions:
    options = pycolmap.IncrementalPipelineOptions()
    options.min_model_size = SMALLEST_MODEL
    options.num_threads = THREADS
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    return options


def _global_options(seed: int) -> pycolmap.GlobalPipelineOptions:
    options = pycolmap.GlobalPipelineOptions()
    options.min_model_size = SMALLEST_MODEL
    mapper = options.mapper
    mapper.track_required_tracks_per_view = _TRACKS
    options.num_threads = mapper.num_threads = mapper.bundle_adjustment.ceres.solver_options.num_threads = THREADS
    for part in (options, mapper, mapper.rotation_averaging, mapper.global_positioning, mapper.retriangulation):
        part.random_seed = seed
    return options


def _hierarchical_options(seed: int) -> pycolmap.HierarchicalPipelineOptions:
    options = pycolmap.HierarchicalPipelineOptions()
    options.num_threads = options.num_workers = THREADS
    options.incremental_options = _incremental_options(seed)
    options.clustering_options.leaf_max_num_images = _PART
    options.clustering_options.image_overlap = _SHARED
    return options
