"""Configuration of the photos stage."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class PhotosConfig(StageConfig):
    """What counts as a usable photograph, and how large the working copies are."""

    max_px: int = Field(
        default=1024, ge=64, le=16384, description="Longest side of a working copy; never enlarged [px]."
    )
    min_px: int = Field(
        default=160,
        ge=16,
        le=4096,
        description="Shortest side, as photographed, below which a photograph is left out [px].",
    )
    least_motion: float = Field(
        default=0.0,
        ge=0.0,
        le=0.5,
        description="Least motion of the picture from one photograph to the next, of its width; what moves less, as in a "
        "video, is left out; 0: none is [share].",
    )
    min_photos: int = Field(
        default=4, ge=3, le=1000, description="Fewest usable photographs; with less the run stops [photographs]."
    )


PRESETS: dict[str, PhotosConfig] = {
    "tiny": PhotosConfig(),
    "small": PhotosConfig(max_px=1600),
    "paper": PhotosConfig(max_px=2048),
}
