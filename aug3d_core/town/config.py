"""Settings of the built-in town and of the flight over it."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig

FlightPath = Literal["lawnmower", "nadir", "crossed", "oblique", "orbit", "free", "abrupt"]
TerrainKind = Literal["hills", "slope", "terraces"]
Buildings = Literal["mixed", "suburb", "dense", "industry", "high_rise", "identical"]
Season = Literal["summer", "dry", "autumn", "winter"]


class TownConfig(StageConfig):
    """The town, the flight and the camera. The number of photographs follows from size, altitude and overlaps."""

    seed: int = Field(default=7, ge=0, le=2**31 - 1, description="Seed of all random choices.")
    length_m: float = Field(
        default=220.0, ge=60, le=2000, description="East-west size of the town, along the flight lines [m]."
    )
    width_m: float = Field(default=130.0, ge=60, le=2000, description="North-south size of the town [m].")
    terrain: TerrainKind = Field(
        default="hills", description="hills: gentle, 2 m high; slope: rises to the north; terraces: rises in steps."
    )
    slope_deg: float = Field(
        default=10.0, ge=0, le=30, description="Mean slope of the terrains slope and terraces [degrees]."
    )
    buildings: Buildings = Field(
        default="mixed",
        description="mixed: houses of all kinds; suburb: detached houses; dense: rows and flats; industry: halls; "
        "high_rise: towers; identical: copies of one house.",
    )
    trees_share: float = Field(default=1.0, ge=0, le=1, description="Share of the trees that are planted [share].")
    season: Season = Field(default="summer", description="Colours of what grows; in winter snow lies on the ground.")
    sun_azimuth_deg: float = Field(
        default=152.0, ge=0, lt=360, description="Direction to the sun, clockwise from north [degrees]."
    )
    sun_elevation_deg: float = Field(default=47.0, ge=5, le=90, description="Height of the sun [degrees].")
    bare_roofs: bool = Field(default=False, description="Give each roof one colour and no texture.")
    lake: bool = Field(default=False, description="Flood a part of the town. Ripples differ in every photograph.")

    path: FlightPath = Field(
        default="lawnmower",
        description="Flight path. lawnmower: parallel lines; nadir: lines, looking straight down; crossed: lines in both "
        "directions; oblique: crossed, tilted by 40 degrees; orbit: rings, looking inwards; free: drifts, turns and rises; "
        "abrupt: straight legs with sharp turns.",
    )
    altitude_m: float = Field(default=55.0, ge=30, le=500, description="Flight height above the ground [m].")
    tilt_deg: float = Field(
        default=12.0,
        ge=0,
        le=45,
        description="Camera tilt from straight down; for lawnmower, crossed and abrupt [degrees].",
    )
    forward_overlap: float = Field(
        default=0.76,
        ge=0.3,
        le=0.99,
        description="Overlap of successive photographs; video frames have 0.95 or more [share].",
    )
    side_overlap: float = Field(
        default=0.67, ge=0.2, le=0.95, description="Overlap of photographs on neighbouring lines [share]."
    )
    max_photos: int | None = Field(
        default=None, ge=1, description="Largest number of photographs; none: no limit [photographs]."
    )

    focal_35mm: int = Field(
        default=27,
        ge=14,
        le=100,
        description="Focal length, 35 mm equivalent [mm]; 27 gives a field of view of 65 degrees.",
    )
    width_px: int = Field(
        default=640, ge=160, le=4000, description="Width of a photograph [px]; its height is 3/4 of that."
    )
    radial_k1: float = Field(
        default=0.0, ge=-0.3, le=0.3, description="Lens distortion: k1 of COLMAP's RADIAL model [1]."
    )
    radial_k2: float = Field(
        default=0.0, ge=-0.1, le=0.1, description="Lens distortion: k2 of COLMAP's RADIAL model [1]."
    )
    blur_px: float = Field(default=0.0, ge=0, le=30, description="Standard deviation of the blur [px].")
    blur_share: float = Field(default=1.0, ge=0, le=1, description="Share of the photographs that are blurred [share].")
    noise_levels: float = Field(
        default=1.3, ge=0, le=50, description="Standard deviation of the sensor noise [levels of 255]."
    )
    exposure_factor: float = Field(
        default=1.0,
        ge=0.1,
        le=10,
        description="Exposure of the last part of the flight, relative to the first part [factor].",
    )
    exposure_share: float = Field(
        default=0.5, ge=0, le=1, description="Share of the photographs in that last part [share]."
    )

    gps: bool = Field(default=True, description="Write GPS positions into the photographs.")
    gps_noise_m: float = Field(
        default=1.5, ge=0, le=50, description="Standard deviation of the GPS position per axis [m]."
    )
    gps_gross_share: float = Field(
        default=0.0, ge=0, le=1, description="Share of the photographs with a grossly wrong GPS position [share]."
    )
    gps_gross_m: float = Field(default=100.0, ge=0, le=100_000, description="Horizontal error of those positions [m].")
    gps_altitude_off_m: float = Field(
        default=0.0, ge=-1000, le=1000, description="Constant error of all GPS altitudes [m]."
    )
    exif_focal_factor: float = Field(
        default=1.0, ge=0, le=5, description="Focal length in EXIF, relative to the true one; 0 leaves it out [factor]."
    )

    samples: int = Field(default=6, ge=1, le=4096, description="Rendered samples per pixel [samples].")
    photos_per_shard: int = Field(
        default=20, ge=1, le=10_000, description="Photographs per render process [photographs]."
    )

    @property
    def height_px(self) -> int:
        """Height of a photograph [px]."""
        return round(self.width_px * 3 / 4)

    @property
    def focal_px(self) -> float:
        """Focal length [px]. EXIF's 35 mm equivalent compares diagonals; the film's diagonal is 43.27 mm."""
        return self.focal_35mm / 43.27 * math.hypot(self.width_px, self.height_px)


class TruthConfig(StageConfig):
    """No settings."""


class MeshTruthConfig(StageConfig):
    """No settings."""


PRESETS: dict[str, TownConfig] = {
    "tiny": TownConfig(),
    "small": TownConfig(length_m=320, width_m=220, width_px=1024),
    "paper": TownConfig(length_m=600, width_m=420, altitude_m=70, width_px=1600, samples=64),
}
TRUTH_PRESETS: dict[str, TruthConfig] = {name: TruthConfig() for name in PRESETS}
MESH_TRUTH_PRESETS: dict[str, MeshTruthConfig] = {name: MeshTruthConfig() for name in PRESETS}
