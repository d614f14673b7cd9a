"""A surface in tiles of ground is the surface: on the truth, closed at the borders, the same with any number of processes."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import EVERYWHERE, Halved, Planned
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.stored_points import StoredPoints
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.draw import Drawn, _each, draw
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.join import rim_edges
from aug3d_core.surface.kept import Kept
from aug3d_core.surface.poisson import CELL_SPACINGS, reconstruct
from aug3d_core.surface.tiles import plan_tiles
from tests.engines.test_surface import LAKE, LAKE_RADIUS, hills, on_hills

COUNT, MOST = 24_000, 7_000
CONFIG = SurfaceConfig(max_gap_spacings=12)


@pytest.fixture(scope="module")
def fused(tmp_path_factory) -> Path:
    """Points on the hills, with a lake where there are none and a blob above, next to where the ground is halved."""
    points = on_hills(hills(), COUNT, np.random.default_rng(0))
    dry = np.linalg.norm(points.xyz[:, :2] - LAKE, axis=1) >= LAKE_RADIUS
    path = tmp_path_factory.mktemp("fused") / "fused.npz"
    Fused(*(getattr(points, name)[dry] for name in ("xyz", "normals", "rgb", "views"))).save(path)
    return path


def above(height: float = 60.0) -> Views:
    """One view that looks straight down on everything."""
    pose = look_at(np.array([0.0, 0.0, height]), np.array([0.0, 1e-3, 0.0]))
    return Views(np.array([0]), pose[None], np.array([[150.0, 150.0, 120.0, 120.0]]), np.array([[240, 240]]))


def drawn(fused: Path, most: int, at_once: int | None = 1) -> tuple[Drawn, list[tuple[int, int]]]:
    said: list[tuple[int, int]] = []
    return draw(fused, above(), np.array([0]), CONFIG, Clock(), lambda *tiles: said.append(tiles), most, at_once), said


@pytest.fixture(scope="module")
def tiled(fused) -> tuple[Drawn, list[tuple[int, int]]]:
    return drawn(fused, MOST)


@pytest.fixture(scope="module")
def whole(fused) -> Drawn:
    return drawn(fused, COUNT + 100)[0]


def borders(plan) -> list[Halved]:
    return [plan, *borders(plan.below), *borders(plan.above)] if isinstance(plan, Halved) else []


def test_tiles_lie_on_the_hills_as_the_whole_does(tiled, whole):
    truth = hills()
    caster = Raycaster(truth.xyz, truth.triangles)
    off = []
    for surface in (tiled[0], whole):
        xyz = surface.shape.xyz
        inner = (np.abs(xyz[:, :2]) < 38).all(axis=1)
        off.append(np.percentile(caster.distance(xyz[inner]), 95))
    assert off[0] < 1.1 * off[1] + 0.01
    assert whole.tiles == 1
    assert tiled[0].tiles == 4
    assert np.isclose(tiled[0].spacing, whole.spacing, rtol=0.05)
    assert np.isclose(tiled[0].points, whole.points, rtol=0.01)
    assert np.isclose(tiled[0].area, whole.area, rtol=0.03)
    assert np.isclose(tiled[0].ground_sampling, whole.ground_sampling, rtol=0.1)
    assert tiled[0].decimation_error <= 1.02 * CONFIG.max_error_gsd * 1.1 * whole.ground_sampling


def test_borders_are_closed_and_neither_hidden_nor_doubled(fused, tiled):
    shape = tiled[0].shape
    caster, truth = Raycaster(shape.xyz, shape.triangles), hills()
    true = Raycaster(truth.xyz, truth.triangles)
    for border in borders(plan_tiles(StoredPoints.open(fused), MOST)):
        ends = rim_edges(shape, border)
        middle = shape.xyz[ends].mean(axis=1)
        inside = (np.abs(middle[:, :2]) < 39).all(axis=1) & (
            np.linalg.norm(middle[:, :2] - LAKE, axis=1) > LAKE_RADIUS + 1
        )
        assert not inside.any()
        # Rays down at the border and just beside it meet the hills, and nothing under them
        across = np.linspace(-37, 37, 149)
        for beside in (-0.05, 0.0, 0.05):
            from_above = np.full((len(across), 3), 30.0)
            from_above[:, border.axis], from_above[:, 1 - border.axis] = border.at + beside, across
            dry = np.linalg.norm(from_above[:, :2] - LAKE, axis=1) > LAKE_RADIUS + 1
            dry &= border.ground.holds(from_above)
            down = np.array([0.0, 0.0, -1.0])
            hit = caster.cast(from_above[dry], down)
            expected = true.cast(from_above[dry], down).distance
            assert (hit.triangle >= 0).all()
            np.testing.assert_allclose(hit.distance, expected, atol=0.3)
            beyond = from_above[dry] + (hit.distance + 0.3)[:, None] * down
            assert (caster.cast(beyond, down).triangle < 0).all()


def test_the_lake_stays_a_hole_and_the_blob_goes_as_of_the_whole(tiled):
    xyz = tiled[0].shape.xyz
    assert np.linalg.norm(xyz[:, :2] - LAKE, axis=1).min() > LAKE_RADIUS - 1.5
    assert xyz[:, 2].max() < 5


def test_the_number_of_processes_changes_no_byte_and_tiles_are_told(fused, tiled):
    two, said = drawn(fused, MOST, 2)
    np.testing.assert_array_equal(two.shape.xyz, tiled[0].shape.xyz)
    np.testing.assert_array_equal(two.shape.triangles, tiled[0].shape.triangles)
    assert said == tiled[1] == [(n, 4) for n in range(5)]


def test_a_tile_that_is_drawn_already_is_not_drawn_again(fused, tmp_path):
    """The view sees no more than the tiles on one side, so that of some it is kept that they have no surface."""
    views = above()
    beside = Views(
        views.photo_id, views.cam_from_world, views.intrinsics * (1, 1, -0.75, 1), views.size // np.array([2, 1])
    )

    def pieces() -> dict[str, int]:
        return {file.name: file.stat().st_mtime_ns for file in tmp_path.iterdir()}

    def again() -> Drawn:
        return draw(fused, beside, np.array([0]), CONFIG, Clock(), most=MOST, at_once=1, kept=Kept(tmp_path))

    first, before = again(), pieces()
    assert sorted(before) == [f"tile_{n:05}.npz" for n in range(4)]
    assert 0 < first.points < 0.6 * COUNT
    lost = min(before)
    (tmp_path / lost).unlink()
    second, after = again(), pieces()
    assert {name for name in after if after[name] != before[name]} == {lost}
    np.testing.assert_array_equal(second.shape.xyz, first.shape.xyz)
    np.testing.assert_array_equal(second.shape.triangles, first.shape.triangles)
    assert replace(second, shape=first.shape) == first


def test_what_no_photograph_frames_is_refused_tiles_or_not(fused):
    away = Views(
        above().photo_id, above().cam_from_world + np.array([[0, 0, 0, 1e4]] * 3), above().intrinsics, above().size
    )
    for most in (COUNT + 100, MOST):
        with pytest.raises(InputError, match="no photograph frames"):
            draw(fused, away, np.array([0]), CONFIG, Clock(), most=most, at_once=1)


def test_cells_are_two_spacings_wide():
    x, y = np.meshgrid(np.arange(0, 40, 0.5), np.arange(0, 23, 0.5))
    flat = np.column_stack([x.ravel(), y.ravel(), 0.1 * np.sin(x.ravel())])
    shape = reconstruct(Evidence(flat, np.tile([0, 0, 1.0], (len(flat), 1)), 0.5))
    # Corners lie on the edges of cells: of two of three coordinates each is a whole number of cells from any other
    inner = shape.xyz[(np.abs(shape.xyz[:, :2] - [20, 11]) < 9).all(axis=1)]
    places = np.unique(np.round(inner[:, 0], 6), return_counts=True)
    often = places[0][places[1] > 10]
    steps = np.diff(often) / (CELL_SPACINGS * 0.5)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)
    assert steps.min() > 0.9


def killed(numbered: tuple[int, Planned]) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_tile_whose_process_is_killed_is_an_error_that_is_tried_again():
    with pytest.raises(WorkerDied, match="was killed") as died:
        list(_each(killed, [(0, Planned(EVERYWHERE, 1.0))], 1))
    assert died.value.cause == "killed"
