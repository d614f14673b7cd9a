"""The factory as a list: every stage, what it reads, and which library does its work.

Read it from top to bottom and you have read the method. The configurations are light to import; the stage functions are
imported only in the process that runs them.
"""

from __future__ import annotations

from collections.abc import Iterable

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.depth.config import DepthConfig
from aug3d_core.formats.config import PosesConfig
from aug3d_core.grouping.config import GroupingConfig, OverlapConfig, SimilarityConfig
from aug3d_core.nerf.config import EvaluationConfig, PredictionConfig, TrainingConfig
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sfm.config import MatchingConfig, SfmConfig
from aug3d_core.stability.config import ComputedConfig, SpoilConfig
from aug3d_core.stage import Stage
from aug3d_core.store import layout
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.testbed.config import MeshTruthConfig, TownConfig, TruthConfig

TOWN = Stage(
    "town", TownConfig, (), "aug3d_core.testbed.town_stage:run", ("bpy", "pillow", "scipy"), "photos", resumable=True
)
PHOTOS = Stage(
    "photos", PhotosConfig, ("folder",), "aug3d_core.photos.stage:run", ("opencv-python-headless", "pillow"), "photos"
)
MATCHING = Stage(
    "matching",
    MatchingConfig,
    ("photos",),
    "aug3d_core.sfm.matching_stage:run",
    ("pillow", "pycolmap", "scipy"),
    "pairs_matched_share",
    grows=True,
)
SFM = Stage(
    "sfm",
    SfmConfig,
    ("photos", "matching"),
    "aug3d_core.sfm.stage:run",
    ("pillow", "pycolmap", "scipy"),
    "reprojection_px",
    grows=True,
)
POSES = Stage(
    "poses",
    PosesConfig,
    ("photos", "given"),
    "aug3d_core.formats.stage:run",
    ("pillow", "pycolmap", "torch"),
    "matched_share",
)
# What sfm makes, from poses that were given. Without points beside them, matches and the poses give the points.
_IMPORT = "aug3d_core.sfm.import_stage:run"
SFM_OF_MODEL = Stage("sfm", SfmConfig, ("photos", "poses"), _IMPORT, ("pillow", "pycolmap", "scipy"), "reprojection_px")
SFM_OF_POSES = Stage(
    "sfm", SfmConfig, ("photos", "poses", "matching"), _IMPORT, ("pillow", "pycolmap", "scipy"), "reprojection_px"
)
TRUTH = Stage("truth", TruthConfig, ("town", "sfm"), "aug3d_core.testbed.truth_stage:run", (), "position_error_pct")
SIMILARITY = Stage(
    "similarity", SimilarityConfig, ("sfm",), "aug3d_core.grouping.similarity_stage:run", ("scipy",), "connected_share"
)
GROUPING = Stage(
    "grouping",
    GroupingConfig,
    ("sfm", "similarity"),
    "aug3d_core.grouping.stage:run",
    ("scipy",),
    "shared_points_median",
)
_SPLIT_ALONE = {"grouping": (layout.SPLIT_TABLE,)}  # other groups of the same split are nothing to them
DEPTH = Stage(
    "depth",
    DepthConfig,
    ("sfm", "grouping"),
    "aug3d_core.depth.stage:run",
    ("opencv-python-headless", "pillow", "pycolmap"),
    "consistent_share",
    reads=_SPLIT_ALONE,
)
SURFACE = Stage(
    "surface",
    SurfaceConfig,
    ("sfm", "grouping", "depth"),
    "aug3d_core.surface.stage:run",
    ("open3d", "pillow", "scipy"),
    "render_psnr",
    reads=_SPLIT_ALONE,
)
OVERLAP = Stage(
    "overlap",
    OverlapConfig,
    ("sfm", "similarity", "grouping", "surface"),
    "aug3d_core.grouping.overlap_stage:run",
    ("open3d", "pillow", "scipy"),
    "bad_members_share",
)
OVERLAP_IN_TOWN = Stage(
    "overlap",
    OverlapConfig,
    ("town", "sfm", "similarity", "grouping"),
    "aug3d_core.testbed.overlap_stage:run",
    ("open3d", "pillow", "scipy"),
    "bad_members_share",
)
MESH_TRUTH = Stage(
    "mesh_truth",
    MeshTruthConfig,
    ("town", "sfm", "grouping", "surface"),
    "aug3d_core.testbed.mesh_truth_stage:run",
    ("open3d", "pillow"),
    "fscore_half_pct",
    reads=_SPLIT_ALONE,
)
SAMPLING = Stage(
    "sampling",
    SamplingConfig,
    ("sfm", "grouping", "surface"),
    "aug3d_core.sampling.stage:run",
    ("open3d", "scikit-image", "scipy"),
    "reach_share",
)
RENDERING = Stage(
    "rendering",
    RenderingConfig,
    ("surface", "sampling"),
    "aug3d_core.rendering.stage:run",
    ("bpy", "pillow"),
    "kept_share",
    resumable=True,
    alone=True,
)
DATASET = Stage(
    "dataset",
    DatasetConfig,
    ("sfm", "grouping", "surface", "sampling", "rendering"),
    "aug3d_core.dataset.stage:run",
    ("pillow", "scipy", "zarr"),
    "views",
)
# What a study trains on to tell what renders add
DATASET_OF_PHOTOS = Stage(
    "dataset",
    DatasetConfig,
    ("sfm", "grouping", "surface"),
    "aug3d_core.dataset.stage:run",
    ("pillow", "scipy", "zarr"),
    "views",
)
TRAINING = Stage(
    "training",
    TrainingConfig,
    ("dataset",),
    "aug3d_core.nerf.training_stage:run",
    ("torch",),
    "train_psnr",
    resumable=True,
    alone=True,
)
EVALUATION = Stage(
    "evaluation",
    EvaluationConfig,
    ("dataset", "training"),
    "aug3d_core.nerf.evaluation_stage:run",
    ("pillow", "scikit-image", "torch"),
    "test_psnr_mean",
)
# Made on demand, by `aug3d predict`: no run has it.
PREDICTION = Stage(
    "prediction",
    PredictionConfig,
    ("dataset", "training"),
    "aug3d_core.nerf.prediction_stage:run",
    ("pillow", "scikit-image", "torch"),
    "ground_seen_share",
)
# Of the study of stability alone: each is made with the entry of the damage, or of the figure, in place of its own.
SPOILED = Stage("spoiled", SpoilConfig, ("whole",), "aug3d_core.stability.spoil_stage:run", (), "dose")
COMPUTED = Stage("computed", ComputedConfig, (), "aug3d_core.stability.compute_stage:run", (), "accuracy")

FROM_PHOTOS = (
    PHOTOS,
    MATCHING,
    SFM,
    SIMILARITY,
    GROUPING,
    DEPTH,
    SURFACE,
    OVERLAP,
    SAMPLING,
    RENDERING,
    DATASET,
    TRAINING,
    EVALUATION,
)
_AFTER_SFM = FROM_PHOTOS[FROM_PHOTOS.index(SFM) + 1 :]
FROM_POSES = (PHOTOS, POSES, MATCHING, SFM_OF_POSES, *_AFTER_SFM)
FROM_MODEL = (PHOTOS, POSES, SFM_OF_MODEL, *_AFTER_SFM)
_DEPTH, _SURFACE, _SAMPLING = (FROM_PHOTOS.index(stage) for stage in (DEPTH, SURFACE, SAMPLING))
FROM_TOWN = (
    TOWN,
    PHOTOS,
    MATCHING,
    SFM,
    TRUTH,
    *FROM_PHOTOS[3:_DEPTH],
    OVERLAP_IN_TOWN,
    *FROM_PHOTOS[_DEPTH : _SURFACE + 1],
    MESH_TRUTH,
    *FROM_PHOTOS[_SAMPLING:],
)
STAGES = {stage.name: stage for stage in (*FROM_TOWN, POSES, PREDICTION, SPOILED, COMPUTED)}
_BY_INPUTS = {
    (stage.name, frozenset(stage.inputs)): stage for stage in (*FROM_TOWN, *FROM_POSES, *FROM_MODEL, DATASET_OF_PHOTOS)
}


def stage_reading(name: str, inputs: Iterable[str]) -> Stage:
    """Return the stage of a name that reads these inputs: sfm from matches is other work than sfm from given poses."""
    return _BY_INPUTS.get((name, frozenset(inputs) - {layout.EARLIER}), STAGES[name])
