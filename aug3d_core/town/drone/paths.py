"""Flight paths over a flat town about the origin: where photographs are meant to be taken, and which way they look.

Footprints are those on level ground at the flight's altitude. All lengths in metres, x east and y north.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from aug3d_core.town.config import TownConfig

_OBLIQUE_DEG = 40.0
_ORBIT_DEG = 40.0  # steepest look towards the axis; inner rings look straighter down
_INNERMOST = 0.3  # radius of the smallest ring, of the largest
_KITE_DRIFT = 0.3  # deviation of a kite's wandering, of the line spacing
_KITE_TURN_DEG, _KITE_TILT_DEG = 25.0, 9.0  # deviations: heading from photo to photo, tilt
_KITE_SCALE = 0.28  # deviation of the logarithm of a kite's height
_KITE_LOW, _KITE_HIGH = 0.6, 1.7  # of the flight's altitude
_SHARP_DEG = 60.0  # turns between legs of an abrupt path are at least this


class Station(NamedTuple):
    """Camera position, unit heading (the top of the picture), height over the ground, and tilt ahead of straight down."""

    x: float
    y: float
    heading_x: float
    heading_y: float
    altitude_m: float
    tilt_deg: float


def footprint_m(config: TownConfig) -> tuple[float, float]:
    """Return the size of a straight-down photograph's footprint: across the line of flight, and along it."""
    return (
        config.altitude_m * config.width_px / config.focal_px,
        config.altitude_m * config.height_px / config.focal_px,
    )


def _lawnmower(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    yield from _lines(config, config.tilt_deg)


def _nadir(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    yield from _lines(config, 0.0)


def _crossed(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    yield from _both_ways(config, config.tilt_deg)


def _oblique(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    yield from _both_ways(config, _OBLIQUE_DEG)


def _both_ways(config: TownConfig, tilt_deg: float) -> Iterator[Station]:
    yield from _lines(config, tilt_deg)
    turned = config.model_copy(update={"length_m": config.width_m, "width_m": config.length_m})
    for s in _lines(turned, tilt_deg):
        yield s._replace(x=-s.y, y=s.x, heading_x=-s.heading_y, heading_y=s.heading_x)


def _lines(config: TownConfig, tilt_deg: float) -> Iterator[Station]:
    """Fly east and west in turn; what the photographs show is centred on the town."""
    across, along = footprint_m(config)
    ahead = config.altitude_m * np.tan(np.radians(tilt_deg))
    xs = _spread(config.length_m - 0.85 * along, (1 - config.forward_overlap) * along)
    ys = _spread(config.width_m - 0.85 * across, (1 - config.side_overlap) * across)
    for i, y in enumerate(ys):
        sense = 1.0 if i % 2 == 0 else -1.0
        for x in xs[:: int(sense)]:
            yield Station(x - sense * ahead, y, sense, 0.0, config.altitude_m, tilt_deg)


def _orbit(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    """Circle about the town's centre, outermost ring first; neighbours overlap sideways as lines do ahead."""
    across, _ = footprint_m(config)
    largest = min(config.length_m, config.width_m) / 2
    radius = largest
    while radius >= _INNERMOST * largest:
        tilt = min(np.degrees(np.arctan2(radius, config.altitude_m)), _ORBIT_DEG)
        count = int(np.ceil(2 * np.pi * radius / ((1 - config.forward_overlap) * across)))
        for turn in np.arange(count) * 2 * np.pi / count:
            c, s = np.cos(turn), np.sin(turn)
            yield Station(radius * c, radius * s, -c, -s, config.altitude_m, tilt)
        radius -= (1 - config.side_overlap) * across


def _free(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    """Carry a camera under a kite: roughly along lines, but drifting, turning about, and at heights that change."""
    across, _ = footprint_m(config)
    stations = list(_lines(config, 0.0))
    n = len(stations)
    drift = _KITE_DRIFT * (1 - config.side_overlap) * across * np.stack([_wander(n, rng), _wander(n, rng)])
    heading = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(0, np.radians(_KITE_TURN_DEG), n))
    scale = np.clip(np.exp(_KITE_SCALE * _wander(n, rng)), _KITE_LOW, _KITE_HIGH)
    tilt = np.abs(rng.normal(0, _KITE_TILT_DEG, n))
    for i, s in enumerate(stations):
        yield Station(
            s.x + drift[0, i], s.y + drift[1, i], np.cos(heading[i]), np.sin(heading[i]),
            config.altitude_m * scale[i], min(tilt[i], _OBLIQUE_DEG),
        )  # fmt: skip


def _abrupt(config: TownConfig, rng: np.random.Generator) -> Iterator[Station]:
    """Fly straight legs between drawn places, with a sharp turn at each, for as many photographs as lines would take."""
    across, along = footprint_m(config)
    step, count = (1 - config.forward_overlap) * along, len(list(_lines(config, config.tilt_deg)))
    half = np.maximum(0.0, np.array([config.length_m - 0.5 * across, config.width_m - 0.5 * across])) / 2
    at, way, left = rng.uniform(-half, half), np.zeros(2), 0.0
    ahead = config.altitude_m * np.tan(np.radians(config.tilt_deg))
    for _ in range(count):
        if left < step:
            way, left = _next_leg(at, way, half, rng)
        centre = at - way * ahead
        yield Station(centre[0], centre[1], way[0], way[1], config.altitude_m, config.tilt_deg)
        at, left = at + way * step, left - step


def _next_leg(
    at: Float[np.ndarray, " 2"], way: Float[np.ndarray, " 2"], half: Float[np.ndarray, " 2"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, " 2"], float]:
    """Draw places until the turn is sharp and the leg is long; return the new direction and the leg's length."""
    best, best_length = -way if way.any() else np.array([1.0, 0.0]), 0.0
    for _ in range(100):
        leg = rng.uniform(-half, half) - at
        length = float(np.linalg.norm(leg))
        sharp = float(leg @ way) <= length * np.cos(np.radians(_SHARP_DEG))
        if sharp and length > best_length:
            best, best_length = leg / length, length
            if length > half.max() / 2:
                break
    return best, best_length


def _wander(count: int, rng: np.random.Generator) -> Float[np.ndarray, " n"]:
    """Return unit noise that keeps its value for about six steps."""
    keep = 0.85
    value, values = rng.normal(), np.empty(count)
    for i, fresh in enumerate(rng.normal(size=count)):
        value = keep * value + np.sqrt(1 - keep**2) * fresh
        values[i] = value
    return values


def _spread(room_m: float, step_m: float) -> Float[np.ndarray, " n"]:
    """Return positions `step_m` apart and centred on 0 that fill the room; at least two."""
    count = max(2, 1 + round(room_m / step_m))
    return (np.arange(count) - (count - 1) / 2) * step_m


PATHS: dict[str, Callable[[TownConfig, np.random.Generator], Iterator[Station]]] = {
    "lawnmower": _lawnmower,
    "nadir": _nadir,
    "crossed": _crossed,
    "oblique": _oblique,
    "orbit": _orbit,
    "free": _free,
    "abrupt": _abrupt,
}
