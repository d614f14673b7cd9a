"""What the factory knows of the matching and sfm stages."""

from __future__ import annotations

from dataclasses import replace

from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.sfm.config import MATCHING_PRESETS, PRESETS, MatchingConfig, SfmConfig

MATCHING = Stage(
    name="matching",
    description="Features, and which photographs show the same thing.",
    config=MatchingConfig,
    presets=MATCHING_PRESETS,
    inputs=("photos",),
    entry="aug3d_core.sfm.matching_stage:run",
    engines=("pillow", "pycolmap", "scipy"),
    accuracy="pairs_matched_share",
    metrics=declared(
        higher="pairs_matched_share",
        lower="photos_doubted_gps *_seconds match_cpu_seconds",
        neither=(
            "photos photos_reused features_median features_min pairs_possible pairs_tried pairs_reused "
            "pairs_matched pairs_by pairs_ranked"
        ),
    ),
    decidable=("first_octave",),
    resumable=True,
    shards=("unsorted/shards/[!.]*",),
    assist="aug3d_core.sfm.matching_stage:assist",
    grows=True,
)
SFM = Stage(
    name="sfm",
    description="Structure from motion.",
    config=SfmConfig,
    presets=PRESETS,
    inputs=("photos", "matching"),
    entry="aug3d_core.sfm.stage:run",
    engines=("pillow", "pycolmap", "scipy"),
    accuracy="reprojection_px",
    metrics=declared(
        higher="registered registered_share track_length_mean photos_fit_median",
        lower=(
            "reprojection_px gps_residual_m_median focal_exif_over_refined_error control_error_*_m check_error_*_m "
            "control_left_out_m_* photos_contradicted"
        ),
        neither=(
            "photos points observations camera_height_m_median up_from doming_pct doming_sigma_pct "
            "doming_taken_out_pct doming_taken_out_sigma_pct doming_taken_out_by camera_model focal_px "
            "mapper mapper_reason focal_source focal_moved_share heldout_px_* components "
            "grown_from poses_kept poses_reason weakest_joint_points weakest_joint_share camera_height_units_median "
            "control_points check_points control_adjusted corner_light corner_light_sigma light_evened "
            "rolling_shutter rolling_shutter_px rolling_shutter_low_px rolling_shutter_high_px readout_ms"
        ),
    ),
    resumable=True,
    grows=True,
)
# The same output from given poses: with the points beside them, or with points from matches.
SFM_OF_MODEL = replace(
    SFM, inputs=("photos", "poses"), entry="aug3d_core.sfm.import_stage:run", resumable=False, grows=False
)
SFM_OF_POSES = replace(SFM_OF_MODEL, inputs=("photos", "poses", "matching"))
