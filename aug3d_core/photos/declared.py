"""What the factory knows of the photos stage."""

from __future__ import annotations

from aug3d_core.photos.config import PRESETS, PhotosConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

PHOTOS = Stage(
    name="photos",
    description="Finding and checking photographs.",
    config=PhotosConfig,
    presets=PRESETS,
    inputs=("folder",),
    entry="aug3d_core.photos.stage:run",
    engines=("opencv-python-headless", "pillow", "rasterio"),
    accuracy="photos",
    metrics=declared(
        lower="rejected",
        neither=(
            "photos redundant ignored_files masked masked_share with_gps with_focal cameras megapixels_median "
            "sharpness_median sharpness_min"
        ),
    ),
    decidable=("max_px", "least_motion"),
)
