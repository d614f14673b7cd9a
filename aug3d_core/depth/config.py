"""Configuration of the depth stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class DepthConfig(StageConfig):
    """How a depth map is found for each photograph, and what is believed of it."""

    engine: Literal["sweep", "patch_match"] = Field(
        default="sweep",
        description="Plane sweep on the CPU, or COLMAP's patch-match, which needs a CUDA GPU and is no faster there.",
    )
    max_px: int = Field(
        default=512, ge=64, le=8192, description="Width of the depth maps at most; never more than the photo's [px]."
    )
    # Against the exact depth of four towns (docs/trials.md): of the pixels within 0.5 % 3 px loses 2 to 11 points, and 1.5 px
    # gains less than one in 1.3 times the time.
    plane_step_px: float = Field(
        default=2.0,
        gt=0,
        le=20,
        description="Most that a source pixel moves from one plane of the sweep to the next; sets their number [px].",
    )
    sources: int = Field(
        default=6, ge=1, le=20, description="Photographs that each one is compared with [photographs]."
    )


PRESETS: dict[str, DepthConfig] = {
    "tiny": DepthConfig(),
    "small": DepthConfig(max_px=1024),
    "paper": DepthConfig(max_px=2048, sources=8),
}
