"""What the factory knows of the town, and of the stages that compare with its truth."""

from __future__ import annotations

from dataclasses import replace

from aug3d_core.overlap.declared import OVERLAP
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.town.config import MESH_TRUTH_PRESETS, PRESETS, TRUTH_PRESETS, MeshTruthConfig, TownConfig, TruthConfig
from aug3d_core.town.files import TOWN_PHOTOS

TOWN = Stage(
    name="town",
    description="The built-in town; used when there are no photographs.",
    config=TownConfig,
    presets=PRESETS,
    inputs=(),
    entry="aug3d_core.town.stage:run",
    engines=("bpy", "pillow", "scipy"),
    accuracy="photos",
    metrics=declared(
        lower="seconds_per_photo",
        neither="photos triangles buildings",
    ),
    resumable=True,
    shards=(f"{TOWN_PHOTOS}/*.jpg",),
    assist="aug3d_core.town.stage:assist",
)
TRUTH = Stage(
    name="truth",
    description="Comparison with the town's truth.",
    config=TruthConfig,
    presets=TRUTH_PRESETS,
    inputs=("town", "sfm"),
    entry="aug3d_core.town.truth.truth_stage:run",
    engines=(),
    accuracy="position_error_pct",
    metrics=declared(
        higher=(
            "registered_share pose_auc_half_deg pose_auc_one_deg pose_auc_five_deg footprint_iou footprint_iou_min"
        ),
        lower="position_error_pct position_error_pct_max rotation_error_deg rotation_error_deg_max",
    ),
)
MESH_TRUTH = Stage(
    name="mesh_truth",
    description="Comparison of the mesh with the town's truth.",
    config=MeshTruthConfig,
    presets=MESH_TRUTH_PRESETS,
    inputs=("town", "sfm", "grouping", "surface"),
    entry="aug3d_core.town.truth.mesh_truth_stage:run",
    engines=("open3d", "pillow"),
    accuracy="fscore_half_pct",
    metrics=declared(
        higher=(
            "mesh_render_psnr mesh_render_covered accuracy_half_pct completeness_half_pct fscore_half_pct "
            "accuracy_one_pct completeness_one_pct fscore_one_pct"
        ),
        lower="accuracy_median_m completeness_median_m",
        neither="extent_m",
    ),
    reads={"grouping": (SPLIT_TABLE,)},  # other groups of the same split change nothing
)
# Knows the true mesh, so it need not wait for the one that is made.
OVERLAP_IN_TOWN = replace(
    OVERLAP, inputs=("town", "sfm", "similarity", "grouping"), entry="aug3d_core.town.truth.overlap_stage:run"
)
