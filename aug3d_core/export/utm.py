"""Places of a scene's world -> the UTM zone of its origin (WGS 84), for all exports that say where on earth a scene lies."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from rasterio.crs import CRS
from rasterio.warp import transform

from aug3d_core.geometry.geodesy import geodetic_from_enu

_WGS84, _NORTH, _SOUTH = 4326, 32600, 32700  # EPSG; zones are added


def zone_of(origin: Float[np.ndarray, " 3"]) -> CRS:
    """Return the UTM zone of an origin, given as latitude, longitude and altitude."""
    zone = int((origin[1] + 180) // 6) % 60 + 1
    return CRS.from_epsg((_NORTH if origin[0] >= 0 else _SOUTH) + zone)


def utm_from_world(places: Float[np.ndarray, "n 3"], origin: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "n 3"]:
    """Map places of the world to easting and northing in the origin's zone, and altitude [m]."""
    lat, lon, alt = geodetic_from_enu(places, origin).T
    east_north = transform(CRS.from_epsg(_WGS84), zone_of(origin), lon, lat)
    return np.column_stack([*east_north[:2], alt])
