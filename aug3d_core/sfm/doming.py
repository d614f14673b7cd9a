"""Measure doming: the bend of a flight that distortion and depth trade for each other.

Against the altitudes of GPS; or, where all cameras look the same way, by how they lean: bent like a bowl, each leans outward in
proportion to its distance from the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm
from scipy.stats import t as student

from aug3d_core.geometry.transforms import centres

# A bowl of 1 % of the extent leans at its rim by 4 %, 2.3 degrees: more than the 1.5 degrees of doubt about the vertical
# at which `align` stops believing GPS altitudes. The town, unbent, has some hundredths of a percent.
MOST_PCT = 1.0

_FEWEST = 8
_ROUNDS = 30
_PARALLEL_DEG, _ALIKE_DEG = 10.0, 3.0  # off their common direction, and off it and the bend, in the median


@dataclass(frozen=True)
class Doming:
    """Height of the bowl over the flight's extent, and its standard error, in percent of that extent; what told of it.

    The error is larger where few cameras tell it, so that three of it are passed by chance once in 370 flights, however few.
    """

    pct: float
    sigma_pct: float
    told_by: str = "camera heights leave GPS altitudes"

    @property
    def flagged(self) -> bool:
        """Whether the bend is too large to ignore, and larger than the noise of the altitudes explains."""
        return abs(self.pct) > MOST_PCT and abs(self.pct) > 3 * self.sigma_pct

    @property
    def notes(self) -> tuple[str, ...]:
        """What to tell the user of it: nothing, if it is not flagged."""
        if not self.flagged:
            return ()
        return (
            f"the reconstruction is bent like a {'bowl' if self.pct > 0 else 'dome'}: {self.told_by} by {abs(self.pct):.1f} % "
            "of the flight's extent; photographs at an angle, or a second height, would hold it",
        )


def measure_doming(at: Float[np.ndarray, "n 3"], gps_enu_m: Float[np.ndarray, "n 3"]) -> Doming | None:
    """Fit the cameras' heights minus GPS altitudes by a + b x + c y + d r^2, robustly.

    at: camera centres in the world, in metres; rows of `gps_enu_m` without an altitude are NaN. None if there are too few
    positions, or if altitudes are too noisy to tell a bend of `MOST_PCT`. Bowls are positive, domes negative.
    """
    known = np.isfinite(gps_enu_m).all(axis=1)
    if known.sum() < _FEWEST:
        return None
    xy = at[known, :2] - at[known, :2].mean(axis=0)
    extent = float(np.linalg.norm(np.ptp(xy, axis=0)))
    if extent == 0:
        return None
    xy, off = xy / (extent / 2), at[known, 2] - gps_enu_m[known, 2]
    basis = np.column_stack([np.ones(len(xy)), xy, (xy**2).sum(axis=1)])
    fit = np.linalg.lstsq(basis, off, rcond=None)[0]
    for _ in range(_ROUNDS):  # towards least absolute deviations, which wild altitudes hardly move
        weight = 1 / np.maximum(np.abs(off - basis @ fit), 1e-6 * extent)
        fit = np.linalg.lstsq(basis * weight[:, None] ** 0.5, off * weight**0.5, rcond=None)[0]
    # The fit goes through as many cameras as it has terms; what these leave says nothing of the noise (Holland, Welsch 1977)
    left = np.sort(np.abs(off - basis @ fit))[basis.shape[1] :]
    used = np.abs(off - basis @ fit) <= 4 * max(1.4826 * float(np.median(left)), 1e-9 * extent)
    free = int(used.sum()) - basis.shape[1]
    if free < 1:
        return None
    fit = np.linalg.lstsq(basis[used], off[used], rcond=None)[0]
    noise = float(np.sqrt(((off - basis @ fit)[used] ** 2).sum() / free))
    covariance = np.linalg.pinv(basis[used].T @ basis[used])
    few = float(student.ppf(norm.cdf(3), free)) / 3  # three errors of an estimate from few cameras happen more often
    doming = Doming(100 * float(fit[3]) / extent, 100 * few * noise * float(np.sqrt(covariance[3, 3])) / extent)
    return doming if doming.sigma_pct <= MOST_PCT else None


def doming_by_lean(cam_from_world: Float[np.ndarray, "n 3 4"]) -> Doming | None:
    """Fit the cameras' directions by one common direction and a lean away from the middle; scale and level do not matter.

    None if there are too few, if they are in one place, or if they do not look the same way but for such a lean.
    """
    at, axes = centres(cam_from_world), cam_from_world[:, 2, :3]
    common = axes.mean(axis=0)
    if len(at) < _FEWEST or not common.any():
        return None
    across = np.linalg.svd(common[None])[2][1:].T  # two directions at right angles to the common one
    place, lean = (at - at.mean(axis=0)) @ across, (axes - common) @ across
    extent = float(np.linalg.norm(np.ptp(place, axis=0)))
    spread = (place**2).sum()
    if extent == 0 or _median_deg(lean) > _PARALLEL_DEG:
        return None
    rise = float((place * lean).sum() / spread)
    rest = lean - rise * place
    if _median_deg(rest) > _ALIKE_DEG:
        return None
    sigma = float(np.sqrt((rest**2).sum() / (rest.size - 3) / spread))
    to_pct = 100 * extent / 8  # of a parabola that leans by `rise` times the distance, over half the extent
    return Doming(to_pct * rise, to_pct * sigma, "cameras that look the same way lean as on heights that differ")


def _median_deg(leans: Float[np.ndarray, "n 2"]) -> float:
    return float(np.degrees(np.median(np.linalg.norm(leans, axis=1))))
