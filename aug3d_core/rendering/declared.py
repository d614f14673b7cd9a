"""What the factory knows of the rendering stage."""

from __future__ import annotations

from aug3d_core.rendering.config import PRESETS, RenderingConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

RENDERING = Stage(
    name="rendering",
    description="Cycles renders.",
    config=RenderingConfig,
    presets=PRESETS,
    inputs=("surface", "sampling"),
    entry="aug3d_core.rendering.stage:run",
    engines=("bpy", "pillow"),
    accuracy="kept_share",
    metrics=declared(
        higher="kept_share samples_psnr_db views_per_minute",
        lower="overhead_share worker_growth_mib dropped_*",
        neither="views kept samples samples_reason sharpness_median",
    ),
    resumable=True,
    shards=("shards/*.npz",),
    assist="aug3d_core.rendering.stage:assist",
    alone=True,
)
