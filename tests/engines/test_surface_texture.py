"""The atlas and its filling: nothing lies on top of anything, and a picture comes out as it went in."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.surface import atlas as atlas_module
from aug3d_core.surface import texture
from aug3d_core.surface.atlas import GUTTER, LONGEST, SIDE, atlas_within, make_atlas, pack
from aug3d_core.surface.build import _texel, build
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.colour import Colours, Photographs, Places, paint_vertices
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.draw import Drawn
from aug3d_core.surface.shape import Shape, split_to, triangle_areas, triangle_neighbours, triangle_normals
from aug3d_core.surface.texture import paint_texture

QUARTERS = np.array([[[250, 20, 20], [20, 250, 20]], [[20, 20, 250], [250, 250, 20]]], np.uint8)  # red top left


def box(half: float = 5.0) -> Shape:
    """A closed box, wound outwards."""
    xyz = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float) * half
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Shape(xyz, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32))


def spiral(turns: float = 2.5, steps: int = 60) -> Shape:
    """A ramp that winds up over itself: seen from above it covers itself."""
    angle = np.linspace(0, turns * 2 * np.pi, steps)
    rims = [np.column_stack([r * np.cos(angle), r * np.sin(angle), angle / 2]) for r in (3.0, 6.0)]
    i = np.arange(steps - 1)
    n = steps
    triangles = np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])
    return Shape(np.concatenate(rims), triangles.astype(np.int32))


@pytest.mark.parametrize("shape", [box(), spiral()], ids=["box", "spiral"])
def test_every_triangle_has_texels_of_its_own(shape):
    texel = 0.1
    atlas = make_atlas(shape, texel)
    triangle = atlas.triangle_of_texels()
    texels = np.bincount(triangle[triangle >= 0], minlength=len(shape.triangles)) * texel**2
    np.testing.assert_allclose(texels, triangle_areas(shape), rtol=0.3, atol=0.1)  # a slope is seen a little flatter
    assert not atlas.covered().any()
    # Barycentric weights lead back to the texel's centre
    texel = np.flatnonzero(triangle >= 0)
    hits = atlas.hits(texel)
    assert (hits.triangle == triangle.ravel()[texel]).all()
    back = np.einsum("pk,pkx->px", hits.weights, atlas.xy[hits.triangle])
    row, column = np.divmod(texel, atlas.width)
    np.testing.assert_allclose(back, np.column_stack([column, row]) + 0.5, atol=1e-3)
    assert atlas.xy.min() >= GUTTER - 1e-6
    assert (atlas.xy <= np.array([atlas.width, atlas.height]) - GUTTER + 1e-6).all()


def test_a_budget_holds_however_many_charts_a_mesh_falls_into():
    rng = np.random.default_rng(0)
    loose = rng.uniform(0, 100, (400, 1, 3)) + rng.normal(
        0, 1, (400, 3, 3)
    )  # each triangle is a chart, most of it gutter
    shape = Shape(loose.reshape(-1, 3), np.arange(1200, dtype=np.int32).reshape(-1, 3))
    budget = 40_000
    asked = float(np.sqrt(1.6 * triangle_areas(shape).sum() / budget))
    plain = make_atlas(shape, asked)
    atlas, texel = atlas_within(shape, asked, budget)
    assert atlas.width * atlas.height <= budget < plain.width * plain.height and texel > asked
    assert atlas_within(shape, 10 * asked, 10**9)[1] == 10 * asked, "nothing is coarser than it has to be"
    assert atlas_within(shape, asked, 100)[0].charts == atlas.charts, "gutters alone take more than that: it ends"


def ground(
    length: float, width: float, step: float, heading_deg: float = 0.0, arm: float = np.inf, bend: float = 0.0
) -> Shape:
    """A rolling plate of triangles; bend: how far it winds to the sides; arm: of an L, how wide (all in one unit)."""
    x, y = np.meshgrid(np.arange(0, length + step / 2, step), np.arange(0, width + step / 2, step))
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    plan, turn = np.stack([x.ravel(), y.ravel()]), np.radians(heading_deg)
    y = y + bend * np.sin(x / 500)
    east, north = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    shape = Shape(np.stack([east, north, np.sin(x / 20) * np.cos(y / 17)], axis=-1).reshape(-1, 3), triangles)
    return shape.keep(plan[:, triangles].mean(axis=2).min(axis=0) < arm)


GROUNDS: dict[str, Callable[[float], Shape]] = {
    "strip": lambda heading_deg: ground(2000, 100, 20, heading_deg),
    "long strip": lambda heading_deg: ground(10_000, 60, 20, heading_deg),
    "river": lambda heading_deg: ground(5000, 60, 10, heading_deg, bend=300),
    "L": lambda heading_deg: ground(1000, 1000, 20, heading_deg, arm=150),
    "oblong": lambda heading_deg: ground(1000, 500, 20, heading_deg),
    "square": lambda heading_deg: ground(1000, 1000, 20, heading_deg),
}


@pytest.mark.parametrize("heading_deg", [0, 10, 45, 77])
@pytest.mark.parametrize("name", list(GROUNDS))
def test_texels_are_as_small_as_the_budget_allows_whatever_the_ground_looks_like(name: str, heading_deg: float) -> None:
    shape, budget = GROUNDS[name](heading_deg), 8192**2
    area = float(triangle_areas(shape).sum())
    wanted = float(np.sqrt(1.6 * area / budget))
    atlas, texel = atlas_within(shape, wanted, budget)
    assert texel <= 1.02 * wanted
    filled = area / texel**2 / (atlas.width * atlas.height)
    assert filled > (0.6 if name == "river" else 0.74)
    assert max(atlas.width, atlas.height) < 2 * min(atlas.width, atlas.height)
    assert atlas.parts.size.max() <= 1.25 * SIDE
    assert atlas.charts == len(atlas.parts.size) <= (160 if name == "river" else 80)
    assert not atlas.covered().any()


def test_no_side_of_a_texture_is_longer_than_graphics_cards_take() -> None:
    """Two triangles as long as the strip are cut nowhere."""
    strip = Shape(
        np.array([[0, 0, 0], [10_000, 0, 0], [10_000, 60, 0], [0, 60, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    )
    atlas, texel = atlas_within(strip, 0.12, 8192**2)
    assert max(atlas.width, atlas.height) <= LONGEST
    assert 10_000 / texel > 0.9 * LONGEST, "nor smaller than it has to be"


def test_a_chart_that_is_not_long_stays_as_it_lies() -> None:
    shape = ground(20, 10, 1, heading_deg=30)
    atlas = make_atlas(shape, 0.011)
    assert 0.9 * SIDE < max(atlas.width, atlas.height) < SIDE + 2 * GUTTER
    assert atlas.charts == 1 and not len(atlas.parts.size)
    offset = atlas.xy * 0.011 - (shape.xyz * (1, -1, 1))[shape.triangles][..., :2]
    assert np.ptp(offset, axis=(0, 1)).max() < 1e-9, "north up"


def test_a_cut_through_the_ground_is_not_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise from texel to texel: whatever is not the very same texels on both sides shows."""
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 256, (160, 240, 3)).astype(np.uint8)).save(tmp_path / image_name(0))
    views = ground_photo_view()
    plate = ground(20, 12, 1, heading_deg=8)
    shape = Shape(plate.xyz - plate.xyz.mean(axis=0), plate.triangles)
    monkeypatch.setattr(atlas_module, "SIDE", 64)
    monkeypatch.setattr(atlas_module, "LEAST_SIDE", 32)
    atlas = make_atlas(shape, 0.1)
    assert atlas.charts > 5 and len(atlas.parts.size) == atlas.charts
    photographs = Photographs(views, np.arange(1), tmp_path, tmp_path / "masks", shape, 0.1)
    mesh = paint_texture(photographs, shape, np.zeros((len(shape.xyz), 3), np.uint8), atlas, 1, lambda: None)
    here, there = _on_both_sides(mesh, atlas.xy)
    assert len(here) > 500 and here.std() > 20
    np.testing.assert_allclose(here, there, atol=0.5)


def _on_both_sides(mesh: TexturedMesh, texels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the colours of places on edges along which the texture is cut, on either side."""
    sides: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for pair in triangle_neighbours(Shape(mesh.xyz, mesh.triangles)):
        ends = np.intersect1d(*mesh.triangles[pair])
        corners = [[mesh.triangles[one].tolist().index(end) for end in ends] for one in pair]
        if np.allclose(texels[pair[0], corners[0]], texels[pair[1], corners[1]]):
            continue
        for side, one, at in zip(sides, pair, corners, strict=True):
            weights = np.zeros((21, 3))
            weights[:, at[0]], weights[:, at[1]] = np.linspace(1, 0, 21), np.linspace(0, 1, 21)
            side.append(mesh.colour_at(np.full(21, one), weights))
    return np.concatenate(sides[0]), np.concatenate(sides[1])


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(1, 40), st.integers(1, 40)), min_size=1, max_size=60))
def test_packed_boxes_do_not_overlap(sizes):
    size = np.array(sizes)
    place, width, height = pack(size)
    taken = np.zeros((height, width), int)
    for (x, y), (w, h) in zip(place, size, strict=True):
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1
    assert taken.sum() == size.prod(axis=1).sum()


def ground_photo(folder: Path) -> Views:
    """One photo from above of a plate with a colour in each quarter: red in the north-west, green in the north-east."""
    plate = np.kron(QUARTERS, np.ones((80, 120, 1), np.uint8))
    Image.fromarray(plate).save(folder / image_name(0))
    return ground_photo_view()


def ground_photo_view() -> Views:
    pose = look_at(np.array([0.0, 0.0, 20.0]), np.zeros(3))[None]
    return Views(np.zeros(1, int), pose, np.array([[200.0, 200.0, 120.0, 80.0]]), np.array([[240, 160]]))


def textured_plate(folder: Path) -> tuple[TexturedMesh, Views]:
    views = ground_photo(folder)
    xyz = np.array([[-11, -7, 0], [11, -7, 0], [11, 7, 0], [-11, 7, 0.0]])
    shape = Shape(xyz, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    photographs = Photographs(views, np.arange(1), folder, folder / "masks", shape, 0.1)
    colours = paint_vertices(photographs, shape, 1, lambda: None)
    return paint_texture(photographs, shape, colours.rgb, make_atlas(shape, 0.1), 1, lambda: None), views


def test_a_photo_projected_and_rendered_is_the_photo_again(tmp_path):
    mesh, views = textured_plate(tmp_path)
    render = Raycaster(mesh.xyz, mesh.triangles).render(
        mesh, views.cam_from_world[0], views.intrinsics[0], views.size[0]
    )
    truth = np.asarray(Image.open(tmp_path / image_name(0)))
    inner = np.s_[15:145, 15:225]
    off = np.abs(render.rgb[inner].astype(int) - truth[inner])
    assert (render.alpha[inner] == 255).all()
    assert (off.max(axis=-1) > 2).mean() < 0.03  # but for the two lines where quarters meet
    assert (render.rgb[20, 20] == QUARTERS[0, 0]).all()


def test_texels_that_no_photo_sees_take_their_corners_colours(tmp_path):
    views = ground_photo(tmp_path)
    shape = box(2.0)
    photographs = Photographs(views, np.arange(1), tmp_path, tmp_path / "masks", shape, 0.1)
    rgb = np.full((8, 3), 77, np.uint8)
    mesh = paint_texture(photographs, shape, rgb, make_atlas(shape, 0.1), 1, lambda: None)
    normals = triangle_normals(shape)
    third = np.full((len(normals), 3), 1 / 3)
    colour = mesh.colour_at(np.arange(len(normals)), third)
    assert (colour[normals[:, 2] < -0.5] == 77).all()
    assert (np.abs(colour[normals[:, 2] > 0.5] - 77) > 20).any(axis=1).all()


@pytest.mark.parametrize("chunk", [50, 997, 10**6])
def test_it_is_told_once_for_each_photo_however_many_chunks_there_are(
    chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = ground_photo(tmp_path)
    views = Views(
        np.zeros(3, int), *(np.repeat(part, 3, axis=0) for part in (one.cam_from_world, one.intrinsics, one.size))
    )
    shape, ticks, most = box(2.0), list[int](), list[int]()
    photographs = Photographs(views, np.arange(3), tmp_path, tmp_path / "masks", shape, 0.5)
    monkeypatch.setattr(texture, "CHUNK", chunk)
    paint = photographs.paint

    def counted(places: Places, best: int, tick: Callable[[], None], name: str) -> Colours:
        most.append(len(places.xyz))
        return paint(places, best, tick, name)

    monkeypatch.setattr(photographs, "paint", counted)
    rgb = np.full((8, 3), 77, np.uint8)
    paint_texture(photographs, shape, rgb, make_atlas(shape, 0.1), 1, lambda: ticks.append(len(most)))
    assert len(ticks) == 3 and max(most) <= chunk
    assert ticks[-1] == len(most), "the last at the very end"
    assert abs(ticks[0] - len(most) / 3) <= 1


def test_what_is_coloured_at_a_time_lies_together_on_the_ground(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that each photograph is read for few parts, whatever the order of charts in the picture."""
    shape = box(10.0)
    fine = split_to(Shape(shape.xyz, shape.triangles), 0.5, 10**6)
    photographs = Photographs(ground_photo(tmp_path), np.arange(1), tmp_path, tmp_path / "masks", fine, 0.5)
    monkeypatch.setattr(texture, "CHUNK", 1600)
    across: list[float] = []

    def measured(places: Places, best: int, tick: Callable[[], None], name: str) -> Colours:
        across.append(float(np.ptp(places.xyz[:, :2], axis=0).max()))
        return Colours(np.zeros((len(places.xyz), 3), np.uint8), np.zeros(len(places.xyz), bool))

    monkeypatch.setattr(photographs, "paint", measured)
    paint_texture(photographs, fine, np.zeros((len(fine.xyz), 3), np.uint8), make_atlas(fine, 0.1), 1, lambda: None)
    assert len(across) > 100
    assert np.median(across) < 5.0, "top and floor, 800 texels each, would be 2.8 across as a square; a row is 20"


def test_texels_that_a_budget_enlarges_hold_the_mean_of_what_they_cover(tmp_path: Path) -> None:
    """Charts so small that gutters take most of the picture: how large texels become is known only afterwards."""
    rng, px = np.random.default_rng(0), 800
    gravel = rng.normal(128, 40, (px, px, 1)).clip(20, 235).astype(np.uint8).repeat(3, axis=2)
    Image.fromarray(gravel).save(tmp_path / image_name(0))
    focal_px = px / 2 / (12 / 60)
    views = Views(
        np.zeros(1, int), look_at(np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.1, 0.0]))[None],
        np.array([[focal_px, focal_px, px / 2, px / 2]]), np.array([[px, px]]),
    )  # fmt: skip
    across = np.linspace(-10, 10, 25)
    x, y = np.meshgrid(across, across)
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)]).astype(np.int32)
    rough = Shape(np.stack([x, y, rng.normal(0, 0.8, x.shape)], axis=-1).reshape(-1, 3), triangles)
    gsd, area = 60 / focal_px, float(triangle_areas(rough).sum())
    drawn = Drawn(rough, 1000, 1.0, 8, len(triangles), 0.0, gsd, area, 0.0, 1)
    nothing = Tracks(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    config = SurfaceConfig(texel_budget=2**15)
    built = build(drawn, nothing, views, np.arange(1), tmp_path, tmp_path / "masks", config, Clock(), lambda: None)
    enlarged = built.detail / gsd
    asked = _texel(rough, gsd, config) / gsd
    assert enlarged > 1.5 * asked, "else the budget says nothing here"
    assert built.textured is not None and built.textured.texture[..., 0].std() < 1.5 * 40 / enlarged


def test_a_dark_photo_is_evened_out(tmp_path):
    rng = np.random.default_rng(0)
    scene = np.kron(rng.integers(60, 200, (8, 12, 3)), np.ones((20, 20, 1))).astype(np.uint8)
    factor = (1.0, 0.5)
    for i, f in enumerate(factor):
        Image.fromarray(np.rint(scene * f).astype(np.uint8)).save(tmp_path / image_name(i))
    pose = look_at(np.array([0.0, 0.0, 20.0]), np.zeros(3))
    views = Views(
        np.arange(2), np.stack([pose, pose]), np.tile([200.0, 200.0, 120.0, 80.0], (2, 1)), np.tile([240, 160], (2, 1))
    )
    xy = rng.uniform(10, 150, (4000, 2))
    tracks = Tracks(np.repeat(np.arange(4000), 2), np.tile([0, 1], 4000), np.repeat(xy, 2, axis=0))
    ground = Shape(np.array([[-50, -50, 0], [50, -50, 0], [0, 90, 0.0]]), np.array([[0, 1, 2]], np.int32))
    photographs = Photographs(views, np.arange(2), tmp_path, tmp_path / "masks", ground, 0.1)
    photographs.even_out(tracks)
    np.testing.assert_allclose(photographs.gains[1] / photographs.gains[0], 2.0, rtol=0.02)
