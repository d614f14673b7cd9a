"""The factory as a list: every stage, what it reads, and which library does its work.

Read it from top to bottom and you have read the method. The configurations are light to import; the stage functions are
imported only in the process that runs them.
"""

from __future__ import annotations

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.grouping.config import GroupingConfig, SimilarityConfig
from aug3d_core.nerf.config import EvaluationConfig, TrainingConfig
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sfm.config import MatchingConfig, SfmConfig
from aug3d_core.stage import Stage
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.testbed.config import MeshTruthConfig, TownConfig, TruthConfig

TOWN = Stage("town", TownConfig, (), "aug3d_core.testbed.town_stage:run", ("bpy", "scipy"), "photos", resumable=True)
PHOTOS = Stage("photos", PhotosConfig, ("folder",), "aug3d_core.photos.stage:run", ("pillow",), "photos")
MATCHING = Stage(
    "matching",
    MatchingConfig,
    ("photos",),
    "aug3d_core.sfm.matching_stage:run",
    ("pycolmap",),
    "pairs_matched_share",
    grows=True,
)
SFM = Stage(
    "sfm", SfmConfig, ("photos", "matching"), "aug3d_core.sfm.stage:run", ("pycolmap",), "reprojection_px", grows=True
)
TRUTH = Stage("truth", TruthConfig, ("town", "sfm"), "aug3d_core.testbed.truth_stage:run", (), "position_error_pct")
SIMILARITY = Stage(
    "similarity", SimilarityConfig, ("sfm",), "aug3d_core.grouping.similarity_stage:run", ("scipy",), "connected_share"
)
GROUPING = Stage(
    "grouping", GroupingConfig, ("sfm", "similarity"), "aug3d_core.grouping.stage:run", (), "shared_points_median"
)
SURFACE = Stage(
    "surface", SurfaceConfig, ("sfm", "grouping"), "aug3d_core.surface.stage:run", ("open3d",), "render_psnr"
)
MESH_TRUTH = Stage(
    "mesh_truth",
    MeshTruthConfig,
    ("town", "sfm", "grouping", "surface"),
    "aug3d_core.testbed.mesh_truth_stage:run",
    ("open3d",),
    "fscore_half_pct",
)
SAMPLING = Stage(
    "sampling",
    SamplingConfig,
    ("sfm", "grouping", "surface"),
    "aug3d_core.sampling.stage:run",
    ("open3d",),
    "views_planned",
)
RENDERING = Stage(
    "rendering",
    RenderingConfig,
    ("surface", "sampling"),
    "aug3d_core.rendering.stage:run",
    ("bpy",),
    "kept_share",
    resumable=True,
)
DATASET = Stage(
    "dataset",
    DatasetConfig,
    ("sfm", "grouping", "surface", "sampling", "rendering"),
    "aug3d_core.dataset.stage:run",
    ("zarr",),
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
)
EVALUATION = Stage(
    "evaluation",
    EvaluationConfig,
    ("dataset", "training"),
    "aug3d_core.nerf.evaluation_stage:run",
    ("torch",),
    "test_psnr_mean",
)

FROM_PHOTOS = (PHOTOS, MATCHING, SFM, SIMILARITY, GROUPING, SURFACE, SAMPLING, RENDERING, DATASET, TRAINING, EVALUATION)
_UP_TO_SURFACE = FROM_PHOTOS.index(SURFACE) + 1
FROM_TOWN = (
    TOWN,
    PHOTOS,
    MATCHING,
    SFM,
    TRUTH,
    *FROM_PHOTOS[3:_UP_TO_SURFACE],
    MESH_TRUTH,
    *FROM_PHOTOS[_UP_TO_SURFACE:],
)
STAGES = {stage.name: stage for stage in FROM_TOWN}
