"""What the factory knows of the poses stage."""

from __future__ import annotations

from aug3d_core.poses.config import PRESETS, PosesConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

POSES = Stage(
    name="poses",
    description="Camera poses that were given.",
    config=PosesConfig,
    presets=PRESETS,
    inputs=("photos", "given"),
    entry="aug3d_core.poses.stage:run",
    engines=("pillow", "pycolmap", "torch"),
    accuracy="matched_share",
    metrics=declared(
        higher="matched_share",
        neither="format poses matched with_points camera_models resized_share",
    ),
)
