import numpy as np

from aug3d_core.town.generator.model import Frame, Model


def outward_volume(model: Model) -> float:
    """Return the volume inside a closed surface: positive if its triangles face outwards."""
    vertices, triangles, _, _ = model.arrays()
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_a_frame_turns_and_moves():
    placed = Frame(10.0, -3.0, np.pi / 2).place(np.array([[1.0, 0.0, 5.0], [0.0, 1.0, 0.0]]))
    np.testing.assert_allclose(placed, [[10, -2, 5], [9, -3, 0]], atol=1e-12)


def test_a_box_faces_outwards_and_has_its_volume():
    model = Model()
    model.box(Frame(0.0, 0.0, 0.3), (-1, -2, 0), (3, 4, 5), side=7, top=9)
    # It lacks a bottom, which at z = 0 adds nothing to the integral.
    np.testing.assert_allclose(outward_volume(model), 4 * 6 * 5)
    _, triangles, patches, uv = model.arrays()
    assert len(triangles) == 10 and (patches == 7).sum() == 8 and (patches == 9).sum() == 2
    assert uv.min() >= 0 and uv.max() <= 1


def test_pieces_keep_to_their_own_vertices():
    model = Model()
    for x in (0.0, 5.0):
        model.polygon(Frame(x, 0.0, 0.0), [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (-0.5, 0.5, 0)][:4], 0)
    vertices, triangles, _, _ = model.arrays()
    assert set(triangles[:2].ravel()) == {0, 1, 2, 3} and set(triangles[2:].ravel()) == {4, 5, 6, 7}
    assert vertices[4:, 0].min() == 5.0
