"""How far a reconstructed mesh is from the true one, as benchmarks of multi-view stereo measure it.

Accuracy: the share of the reconstruction's area, within the surveyed region, that lies within a distance of the true surface.
The surveyed region is what at least two given photographs have in their frame, hidden or not, so that what was invented
behind walls and under trees counts. Completeness: the share of the true surface's area, of what at least two given
photographs see, that lies within that distance of the reconstruction. F-score: their harmonic mean. Definitions as in Tanks
and Temples (Knapitsch et al. 2017), with exact visibility in place of a hand-drawn crop. Given photographs are all of the
flight but the test's targets, reconstructed or not: what a lost photograph would have shown is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.town.truth.surface_samples import framed, sample_surface

SAMPLES = 200_000  # a share then is good to 0.1 %
_EYES = 2  # photographs that fix a point
_ALMOST = 1 - 1e-3  # of the way to a point: what hides it must be nearer, by centimetres


@dataclass(frozen=True)
class Score:
    """Shares (0..1) at one distance."""

    accuracy: float
    completeness: float

    @property
    def fscore(self) -> float:
        """Harmonic mean of both; 0 when either is."""
        total = self.accuracy + self.completeness
        return 2 * self.accuracy * self.completeness / total if total else 0.0


@dataclass(frozen=True)
class MeshErrors:
    """Samples of both surfaces in the true frame, with their distances (m) to the other surface."""

    found_xyz: Float[np.ndarray, "f 3"]
    found_off_m: Float[np.ndarray, " f"]
    true_xyz: Float[np.ndarray, "t 3"]
    true_off_m: Float[np.ndarray, " t"]

    def score(self, within_m: float) -> Score:
        """Return accuracy and completeness at a distance; of nothing both are 0."""
        return Score(
            *(float((off <= within_m).mean()) if len(off) else 0.0 for off in (self.found_off_m, self.true_off_m))
        )


def compare_meshes(
    found: Mesh, true: Mesh, given: Views, rng: np.random.Generator, samples: int = SAMPLES
) -> MeshErrors:
    """Measure a mesh, already in the true frame, where the `given` true views survey the town."""
    truth = Raycaster(true.xyz, true.triangles)
    true_xyz = sample_surface(true, samples, rng)
    true_xyz = true_xyz[_eyes(true_xyz, given, truth) >= _EYES]
    found_xyz = sample_surface(found, samples, rng)
    found_xyz = found_xyz[_eyes(found_xyz, given, None) >= _EYES]
    if not len(found_xyz):
        return MeshErrors(found_xyz, np.empty(0), true_xyz, np.full(len(true_xyz), np.inf))
    to_found = Raycaster(found.xyz, found.triangles).distance(true_xyz)
    return MeshErrors(found_xyz, truth.distance(found_xyz).astype(float), true_xyz, to_found.astype(float))


def _eyes(points: Float[np.ndarray, "p 3"], views: Views, hiding: Raycaster | None) -> Int[np.ndarray, " p"]:
    """Count the views that have each point in their frame and, where something may hide it, see it."""
    count = np.zeros(len(points), int)
    at = centres(views.cam_from_world)
    for view in range(len(views)):
        inside = np.flatnonzero(framed(points, views, view))
        if hiding is not None and len(inside):
            inside = inside[~_hidden(points[inside], at[view], hiding)]
        count[inside] += 1
    return count


def _hidden(
    points: Float[np.ndarray, "p 3"], eye: Float[np.ndarray, " 3"], hiding: Raycaster
) -> Bool[np.ndarray, " p"]:
    return hiding.occluded(eye, points - eye, _ALMOST)
