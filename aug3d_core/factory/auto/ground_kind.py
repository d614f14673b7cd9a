"""Which surface the ground is taken for. Stages that need it fit it alike; here it is fitted once more, to be told."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.geometry.ground_model import fit_ground
from aug3d_core.geometry.views import Points
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS


def ground_of(sfm: Path) -> Decision:
    """Return the ground model of the sparse points in the folder of stage sfm."""
    rule = "the simplest of level, tilted and smooth that foretells held-out ground as well as any, within a standard error"
    points = Points.load(sfm / POINTS).xyz
    try:
        ground = fit_ground(points, np.random.default_rng(0))
    except InputError as error:
        return Decision(field="sfm.ground", value=None, measured=error.problem, rule=rule)
    measured = f"held-out ground lies {ground.error:.3g} world units off, median, of {len(points):,} points"
    return Decision(field="sfm.ground", value=ground.kind, measured=measured, rule=rule)
