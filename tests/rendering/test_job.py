import pytest

from aug3d_core.rendering.job import Sunlit


@pytest.mark.parametrize("elevation", [5.0, 45.0, 90.0])
def test_an_exposed_light_leaves_level_ground_as_it_was(elevation):
    light = Sunlit(sun_azimuth_deg=10, sun_elevation_deg=elevation)
    exposed = light.exposed()
    assert exposed.level_luminance == pytest.approx(1.0)
    assert exposed.sun_strength / light.sun_strength == pytest.approx(exposed.fill / light.fill)
    assert (exposed.sun_azimuth_deg, exposed.sun_elevation_deg) == (10, elevation)
