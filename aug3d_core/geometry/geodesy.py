"""Latitude, longitude, altitude <-> east, north, up in metres about an origin, on the WGS84 ellipsoid.

Angles in degrees, lengths in metres; positions are rows (lat_deg, lon_deg, alt_m) and (east_m, north_m, up_m).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_A = 6378137.0  # semi-major axis, m
_F = 1 / 298.257223563
_E2 = _F * (2 - _F)


def middle_of(geodetic: Float[np.ndarray, "n k"]) -> Float[np.ndarray, " k"]:
    """Return the median of places (lat, lon, perhaps alt), on both sides of the 180th meridian too."""
    lon = geodetic[:, 1]
    beyond = np.ptp(lon) > 180
    found = np.median(np.column_stack([geodetic[:, 0], lon % 360 if beyond else lon, geodetic[:, 2:]]), axis=0)
    if beyond and found[1] > 180:
        found[1] -= 360
    return found


def enu_from_geodetic(
    geodetic: Float[np.ndarray, "*n 3"], origin_geodetic: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "*n 3"]:
    """Map (lat, lon, alt) to metres east, north and up of the origin."""
    offset = _ecef(geodetic) - _ecef(origin_geodetic)
    return offset @ _enu_from_ecef(origin_geodetic).T


def geodetic_from_enu(
    enu: Float[np.ndarray, "*n 3"], origin_geodetic: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "*n 3"]:
    """Map metres east, north and up of the origin to (lat, lon, alt): the inverse of `enu_from_geodetic`."""
    x, y, z = np.moveaxis(enu @ _enu_from_ecef(origin_geodetic) + _ecef(origin_geodetic), -1, 0)
    from_axis = np.hypot(x, y)
    lat, alt = np.arctan2(z, from_axis * (1 - _E2)), np.zeros_like(z)
    for _ in range(6):  # each round gains about five digits near the ground
        radius = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
        alt = from_axis * np.cos(lat) + z * np.sin(lat) - _A * np.sqrt(1 - _E2 * np.sin(lat) ** 2)
        lat = np.arctan2(z, from_axis * (1 - _E2 * radius / (radius + alt)))
    return np.stack([np.degrees(lat), np.degrees(np.arctan2(y, x)), alt], axis=-1)


def _ecef(geodetic: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    lat, lon, alt = np.radians(geodetic[..., 0]), np.radians(geodetic[..., 1]), geodetic[..., 2]
    radius = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    across = (radius + alt) * np.cos(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), (radius * (1 - _E2) + alt) * np.sin(lat)], axis=-1)


def _enu_from_ecef(origin_geodetic: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    lat, lon = np.radians(origin_geodetic[:2])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    return np.stack([east, np.cross(up, east), up])
