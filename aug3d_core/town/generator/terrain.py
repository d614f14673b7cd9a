"""The lie of the land: how the flat, right-angled plan is bent into the world.

Heights are in metres, functions of the plan's own x (east) and y (north).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.town.config import TerrainKind, TownConfig
from aug3d_core.town.generator.lake import Lake, lake_in

_TURN_DEG = 5.0  # of the plan in the world: streets that run exactly along the flight lines would look drawn

_TERRACE_M = 30.0  # from step to step
_RISER_M = 4.0  # length of the ramp in which a step rises: two cells of the ground's mesh
_SHORE_M = 8.0  # in which the land comes down to a lake


@dataclass(frozen=True)
class Terrain:
    """hills: rolling by 2 m; slope: a plane that rises to the north; terraces: that plane in steps. Lakes are level."""

    kind: TerrainKind = "hills"
    slope_deg: float = 10.0
    lake: Lake | None = None

    @property
    def levels_buildings(self) -> bool:
        """Whether houses stand upright on their own level; on gentle hills they lean with the ground by a degree or two."""
        return self.kind != "hills"

    def height(self, x: Float[np.ndarray, "*n"], y: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"] | float:
        """Return the ground's height."""
        land = self._land(x, y)
        if self.lake is None:
            return land
        level = self.water_level()
        inland = np.clip(self.lake.beyond_m(x, y) / _SHORE_M, 0, 1)
        return level + (land - level) * inland**2 * (3 - 2 * inland)

    def water_level(self) -> float:
        """Return the height of the lake: of the land at its middle."""
        return float(self._land(np.array(self.lake.x), np.array(self.lake.y))) if self.lake else float("nan")

    def trend_in_world(self, x: float, y: float) -> float:
        """Return the height that a flight keeps its distance to, at a place in the world frame (m)."""
        if self.kind == "hills":
            return 0.0
        turn = np.radians(_TURN_DEG)
        return float(self._rise * (np.cos(turn) * y - np.sin(turn) * x))

    @property
    def _rise(self) -> float:
        return float(np.tan(np.radians(self.slope_deg)))

    def _land(self, x: Float[np.ndarray, "*n"], y: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"] | float:
        if self.kind == "hills":
            return 1.1 * np.sin(x * 2 * np.pi / 170 + 1.0) + 0.8 * np.sin(y * 2 * np.pi / 120 + 2.0)
        if self.kind == "slope":
            return self._rise * y
        step, within = np.divmod(y, _TERRACE_M)
        rise = np.clip((within - (_TERRACE_M - _RISER_M) / 2) / _RISER_M, 0, 1)
        return self._rise * (step + rise) * _TERRACE_M


HILLS = Terrain()


def terrain_of(config: TownConfig) -> Terrain:
    """Return the lie of a town's land."""
    return Terrain(config.terrain, config.slope_deg, lake_in(config.length_m, config.width_m) if config.lake else None)


def bend(points_in_town: Float[np.ndarray, "n 3"], terrain: Terrain = HILLS) -> Float[np.ndarray, "n 3"]:
    """Map the flat, right-angled town to the world: streets sway, the ground rolls, all is turned a little."""
    x, y, z = points_in_town.T
    swayed_x, swayed_y = x + 2.5 * np.sin(y * 2 * np.pi / 230 + 0.7), y + 3.0 * np.sin(x * 2 * np.pi / 280 + 0.4)
    c, s = np.cos(np.radians(_TURN_DEG)), np.sin(np.radians(_TURN_DEG))
    lifted = z + terrain.height(x, y)
    return np.stack([c * swayed_x - s * swayed_y, s * swayed_x + c * swayed_y, lifted], axis=1)


def unbend_xy(points_in_world: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """Map places in the world back to the plan."""
    c, s = np.cos(np.radians(_TURN_DEG)), np.sin(np.radians(_TURN_DEG))
    swayed = points_in_world @ np.array([[c, -s], [s, c]])
    x, y = swayed.T
    for _ in range(20):  # the sway is gentle: each round is ten times closer
        x, y = (
            swayed[:, 0] - 2.5 * np.sin(y * 2 * np.pi / 230 + 0.7),
            swayed[:, 1] - 3.0 * np.sin(x * 2 * np.pi / 280 + 0.4),
        )
    return np.stack([x, y], axis=1)
