"""What the factory knows of the sampling stage."""

from __future__ import annotations

from aug3d_core.domes.config import PRESETS, SamplingConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

SAMPLING = Stage(
    name="sampling",
    description="Virtual camera domes.",
    config=SamplingConfig,
    presets=PRESETS,
    inputs=("sfm", "grouping", "surface"),
    entry="aug3d_core.domes.stage:run",
    engines=("open3d", "scikit-image", "scipy"),
    accuracy="reach_share",
    metrics=declared(
        higher="reach_share min_view_covered",
        lower=(
            "worst_view_empty_share worst_view_back_faces_share worst_view_black_share worst_view_smeared_share "
            "rejected_*"
        ),
        neither=(
            "views_planned domes views_per_dome places_passed_over cell_finest_world_units "
            "cell_coarsest_world_units relief_world_units relief_over_cell_ratio sampling_over_finest_ratio "
            "hfov_deg overlap_in_dome_share photos_reach_share uniform_views uniform_reach_share "
            "coverage_views_ratio cameras_tried"
        ),
    ),
    decidable=("width_px", "height_px", "domes"),
)
