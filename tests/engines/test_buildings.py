"""Buildings in rasters of a known village, and the domes that a village and a meadow get."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from aug3d_core.domes.boxes import Buildings, merged, overlap
from aug3d_core.domes.building_chart import draw_buildings
from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.height_raster import MOST_PX, RASTER_PX, HeightRaster, height_raster
from aug3d_core.domes.methods import METHODS
from aug3d_core.domes.orthographic import buildings_among, cut, dividing_height, without_threads
from aug3d_core.domes.place import looked_at
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.run.errors import InputError
from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.terrain import terrain_of
from aug3d_core.town.generator.town import build_town, coloured_mesh
from aug3d_core.town.truth.building_boxes import score_boxes, true_boxes
from tests.engines.little_town import VIEWS_PER_DOME, config, site_over, town

HOUSES = np.array([[-40, -30, -28, -20], [-10, -30, 2, -18], [-2, 10, 30, 22], [-40, 20, -30, 34]], float)
SQUARE, HALF = 0.5, 60.0
SMALLEST = 4.0
LAWN, ROOF, LEAVES = (120, 140, 80), (170, 90, 70), (70, 110, 50)


def village(
    houses: np.ndarray = HOUSES, rise: tuple[float, float] = (0.0, 0.0), trees: int = 0, roof: float = 6.0
) -> HeightRaster:
    """A meadow with houses of flat roofs, and round trees of a rough crown, on a plane that rises by so much a metre."""
    count = round(2 * HALF / SQUARE)
    middles = SQUARE * (np.arange(count) + 0.5) - HALF
    x, y = np.meshgrid(middles, middles)
    height, rgb = rise[0] * x + rise[1] * y, np.empty((count, count, 3), np.uint8)
    rgb[:] = LAWN
    rng = np.random.default_rng(5)
    for _ in range(trees):
        east, north, radius = *rng.uniform(-HALF, HALF, 2), rng.uniform(3, 6)
        crown = np.hypot(x - east, y - north) < radius
        height[crown] += rng.uniform(5, 9, crown.sum())
        rgb[crown] = LEAVES
    for west, south, east, north in houses:
        inside = (x > west) & (x < east) & (y > south) & (y < north)
        height[inside] = rise[0] * (west + east) / 2 + rise[1] * (south + north) / 2 + roof
        rgb[inside] = ROOF
    return HeightRaster(height, rgb, np.array([-HALF, -HALF]), SQUARE)


def find_buildings(ground: HeightRaster, smallest: float = SMALLEST, percentile: float | None = None) -> Buildings:
    piece = cut(ground, smallest, percentile, np.random.default_rng(0))
    return buildings_among(without_threads(piece), piece, ground)


def boxes_in(ground: HeightRaster, percentile: float | None = None) -> np.ndarray:
    return find_buildings(ground, percentile=percentile).boxes


def assert_found(boxes: np.ndarray, true: np.ndarray = HOUSES, by: float = 2 * SQUARE) -> None:
    assert len(boxes) == len(true)
    for box in true:
        assert np.abs(boxes - box).max(axis=1).min() <= by, box


@pytest.mark.parametrize("rise", [(0.0, 0.0), (0.18, 0.0), (-0.1, 0.15)], ids=["level", "10 degrees", "across"])
@pytest.mark.parametrize("trees", [0, 40])
def test_houses_are_found_on_any_slope_and_trees_are_not(rise: tuple[float, float], trees: int) -> None:
    assert_found(boxes_in(village(rise=rise, trees=trees)))


def test_land_that_misses_its_model_is_doubted_and_a_slope_is_not() -> None:
    def doubts(ground: HeightRaster) -> tuple[str, ...]:
        return cut(ground, SMALLEST, None, np.random.default_rng(0)).doubts

    steep = village(rise=(0.3, 0.0), trees=40)
    assert doubts(steep) == ()
    y = SQUARE * (np.arange(steep.height.shape[0]) + 0.5)[:, None]
    assert doubts(replace(steep, height=steep.height + 0.5 * np.floor(y / 30))) == (), "a kerb is no terrace"
    assert "rougher than its" in doubts(replace(steep, height=steep.height + 6.0 * np.floor(y / 30)))[0]


def test_boxes_do_not_depend_on_the_unit() -> None:
    ground = village(rise=(0.1, 0.0), trees=20)
    feet = HeightRaster(ground.height * 3.28, ground.rgb, ground.low * 3.28, ground.square * 3.28)
    found = find_buildings(feet, SMALLEST * 3.28).boxes
    np.testing.assert_allclose(found / 3.28, boxes_in(ground), atol=1e-6)


def test_holes_in_the_surface_do_no_harm() -> None:
    ground = village(trees=20)
    height = ground.height.copy()
    height[:, :25] = np.nan  # a strip of meadow at the rim
    height[150:170, 100:120] = np.nan  # a piece of the third house's roof is not: it lies north of row 140
    height[np.random.default_rng(1).random(height.shape) < 0.01] = np.nan
    assert_found(boxes_in(replace(ground, height=height)), by=3 * SQUARE)


def test_houses_that_touch_are_one_building_and_specks_are_none() -> None:
    row = np.array([[-20, 0, -10, 9], [-10, 0, 0, 9]], float)
    cars = np.array([[20, 20, 24, 22], [20, 30, 22, 34]], float)
    assert_found(boxes_in(village(np.concatenate([row, cars]))), np.array([[-20, 0, 0, 9]]))


def test_one_giant_building_is_found() -> None:
    giant = np.array([[-35, -25, 30, 28]], float)
    assert_found(boxes_in(village(giant, roof=20.0)), giant)


@pytest.mark.parametrize("trees", [0, 60])
def test_a_meadow_and_a_wood_have_no_building(trees: int) -> None:
    assert len(boxes_in(village(np.zeros((0, 4)), rise=(0.05, 0.0), trees=trees))) == 0


def test_an_uneven_car_park_has_no_building() -> None:
    ground = village(np.zeros((0, 4)))
    uneven = gaussian_filter(np.random.default_rng(2).normal(0, 1, ground.height.shape), 8)
    height = ground.height + 0.2 * uneven / uneven.std()
    assert len(boxes_in(replace(ground, height=height, rgb=np.full_like(ground.rgb, 110)))) == 0


def test_a_bank_is_no_building() -> None:
    """A step in the land is as high as a house, but level with what lies behind it."""
    ground = village()
    x = ground.low[0] + ground.square * (np.arange(ground.height.shape[1]) + 0.5)
    banked = replace(ground, height=ground.height + np.where(x > 33, 5.0, 0.0))
    found = boxes_in(banked)
    assert (overlap(HOUSES, found).max(axis=1) > 0.8).all() and len(found) == len(HOUSES)


def test_a_percentile_set_by_hand_slices_where_it_says() -> None:
    two_heights = village(HOUSES[:2])
    tall = village(HOUSES[2:], roof=15.0)
    height = np.maximum(two_heights.height, tall.height)
    rgb = np.where(tall.height[..., None] > 0, tall.rgb, two_heights.rgb)
    ground = HeightRaster(height, rgb, tall.low, tall.square)
    assert_found(boxes_in(ground), HOUSES)
    above = height[height > 0]
    percentile = 100 * (1 - len(above) / height.size) + 100 * np.mean(above < 10) * len(above) / height.size - 1
    assert_found(boxes_in(ground, percentile), HOUSES[2:])  # the plane lies on the low roofs


def test_heights_are_divided_between_the_ground_and_the_lowest_roofs() -> None:
    rng = np.random.default_rng(0)
    heights = np.concatenate([rng.normal(0, 0.2, 8000), rng.uniform(5, 15, 2000)])
    assert 0.4 < dividing_height(heights) < 5
    assert dividing_height(np.zeros(10)) == 0


def test_without_a_ground_there_is_nothing_to_stand_out_from() -> None:
    tower = HeightRaster(np.full((2, 2), 3.0), np.zeros((2, 2, 3), np.uint8), np.zeros(2), 1.0)
    with pytest.raises(InputError, match="no ground"):
        boxes_in(tower)


def domes_in(tower: float, **changes: object) -> Plan:
    surface, site = site_over(town(tower))
    site = replace(site, ground=replace(site.ground, rgb=np.full_like(site.ground.rgb, 128)))
    return METHODS["buildings"](surface, site, config(**changes), np.random.default_rng(0))


def test_the_tower_alone_gets_a_dome() -> None:
    answer = domes_in(tower=4.0)
    assert answer.buildings is not None and answer.notes == ()
    np.testing.assert_allclose(answer.buildings.boxes, [[-3, -3, 3, 3]], atol=0.5)
    (dome,) = answer.domes
    np.testing.assert_allclose([dome.x, dome.y, dome.z, dome.cell], [0, 0, 4, 8], atol=0.7)
    assert dome.views == VIEWS_PER_DOME == len(answer.cameras) and dome.why.startswith("building:")


def test_without_buildings_domes_stand_over_a_grid_and_it_is_said() -> None:
    answer = domes_in(tower=0.0)
    assert any("no building is at least" in note for note in answer.notes)
    surface, site = site_over(town())
    grid = METHODS["grid"](surface, site, config(), np.random.default_rng(0))
    assert len(answer.cameras) > 0 and abs(len(answer.domes) - len(grid.domes)) <= 2


def test_houses_get_domes_alone_and_together_and_no_more_than_wanted() -> None:
    surface, site = site_over(town())
    # The village's raster over a level mesh of the same size: only where domes stand is asked here
    ground = village(HOUSES * 0.6)
    site = replace(site, ground=ground, finest_sampling=0.05)
    answer = METHODS["buildings"](surface, site, config(domes=5, merged_boxes=2), np.random.default_rng(0))
    assert answer.buildings is not None and len(answer.buildings.boxes) == len(HOUSES)
    places = np.concatenate([answer.buildings.boxes, merged(answer.buildings.boxes, 2)])
    middles = (places[:, :2] + places[:, 2:]) / 2
    for dome in answer.domes:
        assert np.abs(middles - [dome.x, dome.y]).max(axis=1).min() < 1e-9
    assert sum(dome.views > 0 for dome in answer.domes) == 5
    kinds = {dome.why.split(":")[0].split(",")[0] for dome in answer.domes}
    assert kinds == {"building", "buildings together"}


def test_buildings_too_small_for_the_photos_get_no_dome() -> None:
    surface, site = site_over(town(tower=4.0))
    far = replace(site, finest_sampling=1.0)
    assert looked_at(far, 0.0) / 12 > 6  # the tower's side
    answer = METHODS["buildings"](surface, far, config(), np.random.default_rng(0))
    assert any("no building" in note for note in answer.notes)


def test_the_raster_is_as_fine_as_asked_within_reason() -> None:
    corners = np.array([[-40, -1, 0], [40, -1, 0], [40, 1, 0], [-40, 1, 0]], np.float32)  # narrow, so with few squares
    mesh = Mesh(corners, np.full((4, 3), 128, np.uint8), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    surface = Raycaster(mesh.xyz, mesh.triangles)
    for widest, square in [(np.inf, 80 / RASTER_PX), (0.1, 0.1), (1.0, 80 / RASTER_PX), (1e-6, 80 / MOST_PX)]:
        assert height_raster(mesh, surface, widest).square == pytest.approx(square)


def test_the_picture_is_written(tmp_path) -> None:
    found = find_buildings(village())
    draw_buildings(found, tmp_path / "with.png", HOUSES)
    nothing = replace(found, mask=np.zeros_like(found.mask), boxes=np.zeros((0, 4)))
    draw_buildings(nothing, tmp_path / "without.png")
    assert (tmp_path / "with.png").stat().st_size > 1000 and (tmp_path / "without.png").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("terrain", ["hills", "slope"])
def test_the_buildings_of_another_town_are_found(terrain: str) -> None:
    """The rule was made on the town's usual seed; its true mesh stands in for a perfect reconstruction."""
    settings = TownConfig(seed=11, length_m=120, width_m=90, terrain=terrain)
    made = build_town(settings, terrain_of(settings), np.random.default_rng(settings.seed))
    mesh = coloured_mesh(made)
    ground = height_raster(mesh, Raycaster(mesh.xyz, mesh.triangles))
    found = find_buildings(ground)
    same = Similarity(1.0, np.eye(3), np.zeros(3))
    asked, allowed = true_boxes([footprint.outline_m for footprint in made.footprints], same, found)
    assert len(asked) >= 8 and score_boxes(found.boxes, asked, allowed).f1 >= 0.9
