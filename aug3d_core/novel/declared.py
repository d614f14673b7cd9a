"""What the factory knows of the stages prediction and preview, which only `aug3d predict` runs."""

from __future__ import annotations

from aug3d_core.novel.config import PredictionConfig, PreviewConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

PREDICTION = Stage(
    name="prediction",
    description="A view that no photograph shows.",
    config=PredictionConfig,
    inputs=("dataset", "training"),
    entry="aug3d_core.novel.stage:run",
    engines=("pillow", "scikit-image", "scipy", "torch"),
    runs=("training",),
    accuracy="ground_seen_share",
    metrics=declared(
        higher="psnr ssim ground_seen_share seen_share",
        neither="head inputs depth_near depth_far",
    ),
)
PREVIEW = Stage(
    name="preview",
    description="Views and a flight of photographs of which only the poses are known.",
    config=PreviewConfig,
    inputs=("sfm", "training"),
    entry="aug3d_core.novel.preview:run",
    engines=("av", "pillow", "scikit-image", "scipy", "torch"),
    runs=("training",),
    accuracy="preview_psnr",
    metrics=declared(
        higher="preview_psnr over_homography_db over_best_cheap_db over_best_cheap_low_db flight_seen_share",
        neither="head photographs cheap_homography cheap_plane_sweep",
    ),
)
