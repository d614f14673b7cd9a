"""Settings of the built-in town and of the flight over it."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from aug3d_core.stage import StageConfig

FlightPath = Literal["lawnmower", "nadir", "crossed", "oblique", "orbit", "free", "abrupt"]
TerrainKind = Literal["hills", "slope", "terraces"]
Buildings = Literal["mixed", "high_rise", "identical"]


class TownConfig(StageConfig):
    """The town, its flight and its camera. The number of photographs follows from size, altitude and overlaps."""

    seed: int = Field(default=7, ge=0, le=2**31 - 1, description="Seed of everything random (number).")
    length_m: float = Field(
        default=220.0, ge=60, le=2000, description="East-west size of the town, along the flight lines (m)."
    )
    width_m: float = Field(default=130.0, ge=60, le=2000, description="North-south size of the town (m).")
    terrain: TerrainKind = Field(
        default="hills", description="hills: gentle, 2 m; slope: rising to the north; terraces: the same in steps."
    )
    slope_deg: float = Field(default=10.0, ge=0, le=30, description="Mean slope of slope and terraces (degrees).")
    buildings: Buildings = Field(
        default="mixed", description="mixed; high_rise: towers; identical: one house, repeated to the pixel."
    )
    bare_roofs: bool = Field(default=False, description="Whether roofs have one colour and no texture (yes or no).")
    lake: bool = Field(
        default=False, description="Whether there is a lake, whose ripples last for one photo (yes or no)."
    )

    path: FlightPath = Field(
        default="lawnmower",
        description="lawnmower; nadir: straight down; crossed: lines both ways; oblique: crossed, 40 degrees ahead; orbit: "
        "rings, looking in; free: as a kite drifts, turns and rises; abrupt: legs with sharp turns.",
    )
    altitude_m: float = Field(default=55.0, ge=30, le=500, description="Height of the flight over the ground (m).")
    tilt_deg: float = Field(
        default=12.0, ge=0, le=45, description="Tilt ahead of straight down: lawnmower, crossed, abrupt (degrees)."
    )
    forward_overlap: float = Field(
        default=0.76,
        ge=0.3,
        le=0.99,
        description="Overlap of successive footprints (share); a video's is 0.95 and more.",
    )
    side_overlap: float = Field(
        default=0.67, ge=0.2, le=0.95, description="Overlap of neighbouring lines' footprints (share)."
    )
    max_photos: int | None = Field(default=None, ge=1, description="Photos after which the flight ends (count).")

    focal_35mm: int = Field(
        default=27, ge=14, le=100, description="Focal length as on 35 mm film (mm); 27 sees 65 degrees."
    )
    width_px: int = Field(
        default=640, ge=160, le=4000, description="Width of a photograph (px); its height is three quarters."
    )
    radial_k1: float = Field(default=0.0, ge=-0.3, le=0.3, description="Lens: k1 of COLMAP's RADIAL model (number).")
    radial_k2: float = Field(default=0.0, ge=-0.1, le=0.1, description="Lens: k2 of COLMAP's RADIAL model (number).")
    blur_px: float = Field(default=0.0, ge=0, le=30, description="Deviation of the blur of blurred photos (px).")
    blur_share: float = Field(default=1.0, ge=0, le=1, description="Photos that blur_px blurs, scattered (share).")
    noise_levels: float = Field(
        default=1.3, ge=0, le=50, description="Standard deviation of the sensor's noise (levels of 255)."
    )
    exposure_factor: float = Field(
        default=1.0, ge=0.1, le=10, description="Exposure of the flight's last part over the first's (factor)."
    )
    exposure_share: float = Field(default=0.5, ge=0, le=1, description="Size of that last part (share of the photos).")

    gps: bool = Field(default=True, description="Whether photos say where they were taken (yes or no).")
    gps_noise_m: float = Field(default=1.5, ge=0, le=50, description="Standard deviation of the GPS per axis (m).")
    gps_gross_share: float = Field(default=0.0, ge=0, le=1, description="Photos whose GPS is plainly wrong (share).")
    gps_gross_m: float = Field(default=100.0, ge=0, le=100_000, description="How far off those are, sideways (m).")
    gps_altitude_off_m: float = Field(
        default=0.0, ge=-1000, le=1000, description="Error of all GPS altitudes alike (m)."
    )
    exif_focal_factor: float = Field(
        default=1.0, ge=0, le=5, description="Focal length in EXIF over the true one; 0 leaves it out (factor)."
    )

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
