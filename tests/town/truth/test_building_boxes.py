from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from aug3d_core.domes.boxes import Buildings
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.town.truth.building_boxes import read_footprints, score_boxes, true_boxes

SAME = Similarity(1.0, np.eye(3), np.zeros(3))
NONE = np.zeros((0, 4))


def outline(west: float, south: float, east: float, north: float) -> np.ndarray:
    return np.array([[west, south], [east, south], [east, north], [west, north]], float)


def surface(square: float = 0.25, low: tuple[float, float] = (-50.0, -50.0), side: float = 100.0) -> Buildings:
    size = round(side / square)
    covered = np.ones((size, size), bool)
    rgb = np.zeros((size, size, 3), np.uint8)
    return Buildings(np.zeros_like(covered), NONE, covered, rgb, np.array(low), square)


def test_touching_houses_are_one_building_and_houses_apart_are_two() -> None:
    row = [outline(-20, 0, -10, 8), outline(-10, 0, 0, 8), outline(3, 0, 13, 8)]
    asked, allowed = true_boxes(row, SAME, surface())
    np.testing.assert_allclose(asked, [[-20, 0, 0, 8], [3, 0, 13, 8]], atol=0.26)
    assert len(allowed) == 0


def test_sheds_may_be_found_and_need_not_be() -> None:
    asked, allowed = true_boxes([outline(0, 0, 3, 3), outline(10, 0, 20, 10)], SAME, surface())
    assert (len(asked), len(allowed)) == (1, 1)
    assert score_boxes(asked, asked, allowed).f1 == 1
    assert score_boxes(np.concatenate([asked, allowed]), asked, allowed).f1 == 1


def test_walls_without_surface_do_not_count() -> None:
    found = surface()
    found.covered[:, 200:] = False  # east of x = 0
    asked, _ = true_boxes([outline(-10, 0, 10, 10), outline(20, 0, 30, 10)], SAME, found)
    np.testing.assert_allclose(asked, [[-10, 0, 0, 10]], atol=0.26)


def test_true_boxes_are_told_in_the_found_world() -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    true_from_found = Similarity(2.0, quarter, np.array([6.0, 4.0, 1.0]))
    asked, _ = true_boxes([outline(10, 0, 30, 8)], true_from_found, surface(0.1, (-20.0, -20.0), 40.0))
    # x_true = -2 y + 6, y_true = 2 x + 4
    np.testing.assert_allclose(asked, [[-2, -12, 2, -2]], atol=0.11)


def test_scores_are_counts_of_pairs() -> None:
    true = np.array([[0, 0, 10, 10], [20, 0, 30, 10], [40, 0, 50, 10], [60, 0, 70, 10]], float)
    found = np.array([[1, 0, 11, 10], [20, 0, 30, 10], [20, 0, 30, 9], [41, 20, 50, 30]], float)
    score = score_boxes(found, true, NONE)
    assert (score.precision, score.recall, score.f1) == (0.5, 0.5, 0.5)
    nothing = score_boxes(NONE, true, NONE)
    assert (nothing.precision, nothing.recall, nothing.f1) == (0, 0, 0)
    assert score_boxes(found, NONE, NONE).f1 == 0


def test_footprints_are_read(tmp_path: Path) -> None:
    file = tmp_path / "footprints.json"
    file.write_text(json.dumps({"footprints": [{"outline_m": outline(0, 0, 4, 5).tolist(), "height_m": 6.0}]}))
    (read,) = read_footprints(file)
    np.testing.assert_array_equal(read, outline(0, 0, 4, 5))
