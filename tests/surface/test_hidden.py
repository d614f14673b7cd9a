import numpy as np
import pytest

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.hidden import with_hidden

MAX_GAP, HOUSE, SHADOW = 28.0, 10.0, 6.0


def net(*kept, slope: float = 0.0) -> Evidence:
    """Points 0.5 apart over [0, 60]^2 where all of `kept` hold, on ground that rises by `slope` along y."""
    x, y = (one.ravel() for one in np.meshgrid(*2 * [np.arange(0.25, 60, 0.5)]))
    house = (np.abs(x - 30) < 10) & (np.abs(y - 30) < 10)
    xyz = np.column_stack([x, y, slope * y + np.where(house, HOUSE, 0.0)])
    xyz = xyz[np.all([keep(x, y) for keep in kept], axis=0)]
    return Evidence(xyz, np.tile([0.0, 0.0, 1.0], (len(xyz), 1)), 0.5)


def lit(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """All but a strip of ground along the wall at x = 40."""
    return ~((x > 40) & (x < 40 + SHADOW) & (np.abs(y - 30) < 10))


def flight(*eyes: tuple[float, float, float]) -> Views:
    """Cameras that look at the house, with all of it in their frame."""
    cam_from_world = np.stack([look_at(np.array(eye, float), np.array([30.0, 30.0, 0.0])) for eye in eyes])
    n = len(eyes)
    return Views(
        np.arange(n), cam_from_world, np.tile([400.0, 400.0, 320.0, 240.0], (n, 1)), np.tile([640, 480], (n, 1))
    )


WEST = flight((0, 30, 60), (2, 25, 60), (4, 35, 60), (6, 31, 60))  # the house hides the strip from all of these
EAST = flight((70, 30, 60), (68, 25, 60), (66, 35, 60))  # these look onto it


def added(evidence: Evidence, views: Views, max_gap: float = MAX_GAP) -> tuple[np.ndarray, np.ndarray]:
    found = with_hidden(evidence, views, np.arange(len(views)), max_gap)
    n = len(evidence.xyz)
    assert np.array_equal(found.xyz[:n], evidence.xyz)
    assert np.array_equal(found.normals[:n], evidence.normals)
    assert found.spacing == evidence.spacing
    return found.xyz[n:], found.normals[n:]


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_ground_goes_on_up_to_a_wall_that_stands_below_the_eaves(slope):
    xyz, normals = added(net(lit, slope=slope), WEST)
    ground, wall = normals[:, 2] == 1, normals[:, 0] == 1
    assert (ground | wall).all()
    strip = (np.abs(xyz[:, 0] - 43) < 4) & (np.abs(xyz[:, 1] - 30) < 11)
    assert strip.all()
    assert np.abs(xyz[ground, 2] - slope * xyz[ground, 1]).max() < 1.0
    squares = {(round(x), round(y)) for x, y in xyz[ground, :2]}
    assert len(squares) >= 0.9 * SHADOW * 20
    assert np.abs(xyz[wall, 0] - 40).max() <= 1
    above = xyz[wall, 2] - slope * xyz[wall, 1]
    assert above.min() < 1.5
    assert HOUSE - 1.5 < above.max() < HOUSE + 0.5


def test_ground_that_photographs_see_is_not_hidden():
    assert len(added(net(lit), WEST)[0])
    assert not len(added(net(lit), EAST)[0])
    assert len(added(net(lit), EAST.take(np.arange(2)))[0])  # two see it: nothing confirms what they see


def test_only_views_of_the_points_count():
    both = flight((0, 30, 60), *[(70 - 2 * i, 30, 60) for i in range(3)])
    n = len(net(lit).xyz)
    assert len(with_hidden(net(lit), both, np.array([0]), MAX_GAP).xyz) > n
    assert len(with_hidden(net(lit), both, np.arange(4), MAX_GAP).xyz) == n


def test_a_gap_wider_than_is_closed_stays():
    xyz, _ = added(net(lit), WEST, max_gap=SHADOW - 2)
    assert not (np.abs(xyz[:, 1] - 30) < 5).any()  # at its ends the gap is narrow, across the corner


@pytest.mark.parametrize(
    ("kept", "what"),
    [
        (lambda x, y: np.hypot(x - 30, y - 30) > 4, "in the middle of a roof"),
        (lambda x, y: np.hypot(x - 10, y - 10) > 4, "in open ground"),
        (lambda x, y: x < 45, "beyond the rim"),
        (lambda x, y: np.ones(len(x), bool), "nowhere"),
    ],
)
def test_a_gap_without_a_step_stays(kept, what):
    nobody = WEST.take(np.array([], dtype=int))
    assert not len(added(net(kept), nobody)[0]), what


def test_a_gentle_slope_across_a_gap_is_no_step():
    x, y = (one.ravel() for one in np.meshgrid(*2 * [np.arange(0.25, 60, 0.5)]))
    xyz = np.column_stack([x, y, 0.7 * x])[np.abs(x - 30) > 4]
    hill = Evidence(xyz, np.tile([0.0, 0.0, 1.0], (len(xyz), 1)), 0.5)
    assert not len(added(hill, WEST.take(np.array([], dtype=int)))[0])


def test_without_points_that_lie_beside_each_other_nothing_is_added():
    line = np.column_stack([np.arange(5.0), np.zeros(5), np.arange(5.0)])
    assert not len(added(Evidence(line, np.tile([0.0, 0.0, 1.0], (5, 1)), 1.0), WEST)[0])


def test_one_stray_far_away_takes_no_more_memory():
    net_ = net(lit)
    far = Evidence(np.vstack([net_.xyz, [[1e6, 1e6, 0.0]]]), np.vstack([net_.normals, [[0.0, 0, 1]]]), 0.5)
    added(far, WEST)
