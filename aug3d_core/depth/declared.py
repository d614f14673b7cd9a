"""What the factory knows of the depth stage."""

from __future__ import annotations

from aug3d_core.depth.config import PRESETS, DepthConfig
from aug3d_core.depth.files import FUSED_TILES
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.split.files import SPLIT_TABLE

DEPTH = Stage(
    name="depth",
    description="A depth map of each photograph, and fused points.",
    config=DepthConfig,
    presets=PRESETS,
    inputs=("sfm", "grouping"),
    entry="aug3d_core.depth.stage:run",
    engines=("opencv-python-headless", "pillow", "pycolmap"),
    accuracy="consistent_share",
    metrics=declared(
        higher="consistent_share",
        lower="seconds_per_photo",
        neither=(
            "photos photos_reused engine depth_width_px points baseline_points tiles baseline_tiles planes_median planes_reason"
        ),
    ),
    decidable=("max_px",),
    resumable=True,
    shards=("raw/[!.]*.bin", "raw/[!.]*.planes", "workspace/stereo/*_maps/[!.]*", f"{FUSED_TILES}/*/[!.]*.npz"),
    assist="aug3d_core.depth.stage:assist",
    grows=True,
    reads={"grouping": (SPLIT_TABLE,)},  # other groups of the same split change nothing
)
