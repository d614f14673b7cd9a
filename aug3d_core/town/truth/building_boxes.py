"""Where the town's buildings truly are, as boxes, and how well found boxes meet them.

Houses whose walls touch are one building, and only what the surface covers counts: walls where there is no surface
cannot be found. What is then smaller than `LEAST_M2`, garden sheds and slivers of houses at the rim, is neither asked for
nor held against a box that meets it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.ndimage import binary_closing
from scipy.optimize import linear_sum_assignment
from skimage.measure import grid_points_in_poly

from aug3d_core.domes.boxes import Buildings, boxes_of, overlap
from aug3d_core.geometry.similarity import Similarity

LEAST_M2 = 25.0
MEETS = 0.5  # intersection over union


@dataclass(frozen=True)
class BoxScore:
    """How many true boxes were found, and how many found ones are true; f1 is the harmonic mean."""

    precision: float
    recall: float

    @property
    def f1(self) -> float:
        """2 p r / (p + r); 0 where nothing meets."""
        both = self.precision + self.recall
        return 2 * self.precision * self.recall / both if both else 0.0


def read_footprints(path: Path) -> list[Float[np.ndarray, "c 2"]]:
    """Return the outlines (m) of the town's buildings in the true world."""
    return [np.array(each["outline_m"], float) for each in json.loads(path.read_text())["footprints"]]


def true_boxes(
    outlines_m: list[Float[np.ndarray, "c 2"]], true_from_found: Similarity, found: Buildings
) -> tuple[Float[np.ndarray, "b 4"], Float[np.ndarray, "s 4"]]:
    """Return the boxes in the found world that should be found, and those that may be.

    Boxes are upright in the found world, in which the samplers work; `found` tells where there
    is surface.
    """
    mask = np.zeros(found.mask.shape, bool)
    for outline in outlines_m:
        # Walls stand upright: any height will do to carry an outline into a world that is turned about z
        level = np.column_stack([outline, np.zeros(len(outline))])
        corners = (true_from_found.inverse().apply(level)[:, :2] - found.low) / found.square - 0.5
        mask |= grid_points_in_poly(mask.shape, corners[:, ::-1])
    touching = binary_closing(np.pad(mask, 1), np.ones((3, 3)))[1:-1, 1:-1]
    boxes = boxes_of(touching & found.covered, found.low, found.square)
    large = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) * true_from_found.scale**2 >= LEAST_M2
    return boxes[large], boxes[~large]


def score_boxes(
    found: Float[np.ndarray, "n 4"], asked: Float[np.ndarray, "b 4"], allowed: Float[np.ndarray, "s 4"]
) -> BoxScore:
    """Pair found boxes with those asked for, one to one, where they overlap by `MEETS`."""
    meets = overlap(found, asked) >= MEETS
    row, column = linear_sum_assignment(meets, maximize=True)
    hits = meets[row, column]
    paired = np.isin(np.arange(len(found)), row[hits])
    wrong = ~paired & ~(overlap(found, allowed) >= MEETS).any(axis=1)
    true = int(hits.sum())
    return BoxScore(true / max(true + int(wrong.sum()), 1), true / max(len(asked), 1))
