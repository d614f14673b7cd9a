"""ENU about an origin: there and back, and lengths known from the ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu, middle_of

LAT = st.floats(-89, 89)
LON = st.floats(-180, 180)
ALT = st.floats(-400, 9000)
OFFSET_M = st.floats(-20_000, 20_000)


@given(LAT, LON, ALT, OFFSET_M, OFFSET_M, st.floats(-1000, 1000))
def test_there_and_back(lat: float, lon: float, alt: float, east: float, north: float, up: float) -> None:
    origin, enu = np.array([lat, lon, alt]), np.array([[east, north, up]])
    np.testing.assert_allclose(enu_from_geodetic(geodetic_from_enu(enu, origin), origin), enu, atol=1e-5)


@given(LAT, LON, ALT)
def test_the_origin_is_zero(lat: float, lon: float, alt: float) -> None:
    origin = np.array([lat, lon, alt])
    np.testing.assert_allclose(enu_from_geodetic(origin[None], origin), 0, atol=1e-8)


@pytest.mark.parametrize(
    ("lat", "metres_per_degree_lat", "metres_per_degree_lon"),
    [(0.0, 110_574.3, 111_319.5), (45.0, 111_131.8, 78_846.8), (60.0, 111_412.3, 55_800.0)],
)
def test_degrees_have_their_published_lengths(
    lat: float, metres_per_degree_lat: float, metres_per_degree_lon: float
) -> None:
    step = 1e-4
    enu = enu_from_geodetic(np.array([[lat + step, 7.0, 0.0], [lat, 7.0 + step, 0.0]]), np.array([lat, 7.0, 0.0]))
    np.testing.assert_allclose(enu[0] / step, [0, metres_per_degree_lat, 0], rtol=1e-5, atol=1)
    np.testing.assert_allclose(enu[1] / step, [metres_per_degree_lon, 0, 0], rtol=1e-5, atol=1)


def test_up_is_altitude() -> None:
    origin = np.array([46.8, -92.0, 180.0])
    np.testing.assert_allclose(enu_from_geodetic(origin + np.array([0, 0, 25.0]), origin), [0, 0, 25], atol=1e-8)


@pytest.mark.parametrize("lon", [-180.0, 179.9999, -179.9999, 0.0, 21.0])
def test_the_middle_of_places_lies_among_them_wherever_they_are(lon: float) -> None:
    east, north = np.meshgrid(np.linspace(-300, 300, 6), np.linspace(-200, 200, 4))
    enu = np.column_stack([east.ravel(), north.ravel(), np.full(east.size, 50.0)])
    origin = np.array([65.5, lon, 10.0])
    places = geodetic_from_enu(enu, origin)
    for order in (places, places[::-1]):
        np.testing.assert_allclose(enu_from_geodetic(middle_of(order), origin), [0, 0, 50], atol=1.0)
    np.testing.assert_allclose(enu_from_geodetic(places, middle_of(places)), enu - [0, 0, 50], atol=1.0)
    assert abs(middle_of(places)[1]) <= 180 and np.array_equal(middle_of(places[:, :2]), middle_of(places)[:2])
