"""Settings of the built-in town and of the flight over it."""

from __future__ import annotations

import math

from pydantic import Field

from aug3d_core.stage import StageConfig


class TownConfig(StageConfig):
    """The town, its flight and its camera. The number of photographs follows from size, altitude and overlaps."""

    seed: int = Field(default=7, ge=0, le=2**31 - 1, description="Seed of everything random (number).")
    length_m: float = Field(
        default=220.0, ge=60, le=2000, description="East-west size of the town, along the flight lines (m)."
    )
    width_m: float = Field(default=130.0, ge=60, le=2000, description="North-south size of the town (m).")
    altitude_m: float = Field(default=55.0, ge=30, le=500, description="Height of the flight over the ground (m).")
    focal_35mm: int = Field(
        default=27, ge=14, le=100, description="Focal length as on 35 mm film (mm); 27 sees 65 degrees."
    )
    width_px: int = Field(
        default=640, ge=160, le=4000, description="Width of a photograph (px); its height is three quarters."
    )
    tilt_deg: float = Field(
        default=12.0, ge=0, le=45, description="Tilt of the camera ahead of straight down (degrees)."
    )
    forward_overlap: float = Field(
        default=0.76, ge=0.3, le=0.95, description="Overlap of successive footprints (share)."
    )
    side_overlap: float = Field(
        default=0.67, ge=0.2, le=0.95, description="Overlap of neighbouring lines' footprints (share)."
    )
    gps_noise_m: float = Field(default=1.5, ge=0, le=50, description="Standard deviation of the GPS per axis (m).")
    samples: int = Field(default=6, ge=1, le=4096, description="Samples per pixel (count).")
    photos_per_shard: int = Field(default=20, ge=1, le=10_000, description="Photos per render process (count).")

    @property
    def height_px(self) -> int:
        """Height of a photograph (px)."""
        return round(self.width_px * 3 / 4)

    @property
    def focal_px(self) -> float:
        """Focal length (px); EXIF's 35 mm equivalent compares diagonals, and the film's is 43.27 mm."""
        return self.focal_35mm / 43.27 * math.hypot(self.width_px, self.height_px)


class TruthConfig(StageConfig):
    """Nothing to set: the comparison has one right way."""


class MeshTruthConfig(StageConfig):
    """Nothing to set: this comparison has one right way, too."""


PRESETS: dict[str, TownConfig] = {
    "tiny": TownConfig(),
    "small": TownConfig(length_m=320, width_m=220, width_px=1024),
    "paper": TownConfig(length_m=600, width_m=420, altitude_m=70, width_px=1600, samples=64),
}
TRUTH_PRESETS: dict[str, TruthConfig] = {name: TruthConfig() for name in PRESETS}
MESH_TRUTH_PRESETS: dict[str, MeshTruthConfig] = {name: MeshTruthConfig() for name in PRESETS}
