"""What the factory knows of the similarity and grouping stages."""

from __future__ import annotations

from aug3d_core.groups.config import GROUPING_PRESETS, SIMILARITY_PRESETS, GroupingConfig, SimilarityConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

SIMILARITY = Stage(
    name="similarity",
    description="The similarity matrix.",
    config=SimilarityConfig,
    presets=SIMILARITY_PRESETS,
    inputs=("sfm",),
    entry="aug3d_core.groups.similarity_stage:run",
    engines=("scipy",),
    accuracy="connected_share",
    metrics=declared(
        higher="connected_share",
        neither="views pairs pairs_share shared_points_mean shared_points_max points_per_view_median",
    ),
)
GROUPING = Stage(
    name="grouping",
    description="Groups of K photographs, and the test split.",
    config=GroupingConfig,
    presets=GROUPING_PRESETS,
    inputs=("sfm", "similarity"),
    entry="aug3d_core.groups.stage:run",
    engines=("scipy",),
    accuracy="shared_points_median",
    metrics=declared(
        higher="coverage",
        lower="left_out leak_shared_share_max leak_shared_share_mean",
        neither=(
            "method k k_reason groups shared_points_mean shared_points_min shared_points_p10 shared_points_median "
            "members_sharing_nothing_share members_apart_share members_unseen_share jaccard_mean "
            "test_shared_points_median folds train_views gap_views support_views target_views "
            "spare_views spare_possible worth_training_on "
            "footprint_world_units gap_footprints gap_shared_share test_kept test_reason"
        ),
    ),
    grows=True,
)
