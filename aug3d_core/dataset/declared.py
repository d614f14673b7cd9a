"""What the factory knows of the dataset stage."""

from __future__ import annotations

from dataclasses import replace

from aug3d_core.dataset.config import PRESETS, DatasetConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

DATASET = Stage(
    name="dataset",
    description="The packed data set.",
    config=DatasetConfig,
    presets=PRESETS,
    inputs=("sfm", "grouping", "depth", "surface", "sampling", "rendering"),
    entry="aug3d_core.dataset.stage:run",
    engines=("open3d", "pillow", "scipy", "zarr"),
    accuracy="views",
    metrics=declared(
        lower="domes_dropped leak_seen_share_mean leak_seen_share_max",
        neither=(
            "views real rendered groups_real groups_rendered groups_test kept_by_crop_share slab_thickness bytes "
            "leak_audit leak_training_photos leak_test_photos leak_common_photos leak_mesh_photos "
            "leak_baseline_photos leak_gap_footprints_min leak_gap_footprints_median"
        ),
    ),
)
DATASET_OF_PHOTOS = replace(
    DATASET, inputs=("sfm", "grouping", "depth", "surface")
)  # a study measures by it what renders add
