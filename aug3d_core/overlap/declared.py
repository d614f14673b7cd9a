"""What the factory knows of the overlap stage."""

from __future__ import annotations

from aug3d_core.overlap.config import PRESETS, OverlapConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

OVERLAP = Stage(
    name="overlap",
    description="What members of groups really see alike, by every way.",
    config=OverlapConfig,
    presets=PRESETS,
    inputs=("sfm", "similarity", "grouping", "surface"),
    entry="aug3d_core.overlap.stage:run",
    engines=("open3d", "pillow", "scipy"),
    accuracy="bad_members_share",
    metrics=declared(
        higher="coverage",
        lower="bad_members_share bad_pairs_share",
        neither=(
            "groups k shared_points_mean shared_points_min shared_points_p10 overlap_mean unjudged_share "
            "jaccard_mean jaccard_max test_bad_members_share bad_members_*_k*"
        ),
    ),
)
