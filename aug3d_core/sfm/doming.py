"""Measure doming: the bend of a flight that distortion and depth trade for each other.

Against the altitudes of GPS; or, where all cameras look the same way, by how they lean: bent like a bowl, each leans outward in
proportion to its distance from the middle.

Altitudes are a barometer's: one that rises and falls by 4 m over a flight of 300 m looks like a bend of 0.4 %. So what varies
slowly along the flight is told apart, and errors of neighbours that are alike count for fewer.
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
_DRIFT_TERMS, _DRIFT_FROM = 3, 20  # a cubic along the flight, where so many altitudes tell it from a bend
_UNLIKE = 0.05  # correlation at which errors no longer count as alike
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


@dataclass(frozen=True)
class AltitudeFit:
    """How heights of cameras leave GPS altitudes.

    drift_m: how far the altitudes have sunk along the flight, 0 where that was not looked for. noise_m: standard deviation of
    what is left; larger where neighbours err alike, so that each altitude can be taken for independent.
    """

    doming: Doming
    drift_m: Float[np.ndarray, " n"]
    noise_m: float


def measure_doming(at: Float[np.ndarray, "n 3"], gps_enu_m: Float[np.ndarray, "n 3"]) -> Doming | None:
    """Return the bend by GPS altitudes, as `fit_altitudes` does; None where they are too noisy to tell one of `MOST_PCT`."""
    fit = fit_altitudes(at, gps_enu_m)
    return fit.doming if fit and fit.doming.sigma_pct <= MOST_PCT else None


def fit_altitudes(at: Float[np.ndarray, "n 3"], gps_enu_m: Float[np.ndarray, "n 3"]) -> AltitudeFit | None:
    """Fit the cameras' heights minus GPS altitudes by a + b x + c y + d r^2 and a drift along the flight, robustly.

    at: camera centres in the world, in metres, in the order of capture; rows of `gps_enu_m` without an altitude are NaN. None
    if too few positions tell the bend from the rest, as on a single line. Bowls are positive, domes negative.
    """
    known = np.isfinite(gps_enu_m).all(axis=1)
    if known.sum() < _FEWEST:
        return None
    middle = at[known, :2].mean(axis=0)
    extent = float(np.linalg.norm(np.ptp(at[known, :2], axis=0)))
    if extent == 0:
        return None
    xy = (at[:, :2] - middle) / (extent / 2)
    along = np.linspace(-1, 1, len(at))
    terms = _DRIFT_TERMS if known.sum() >= _DRIFT_FROM else 0
    drift = np.stack([along**power for power in range(1, terms + 1)], axis=1) if terms else np.zeros((len(at), 0))
    whole = np.column_stack([(xy**2).sum(axis=1), np.ones(len(at)), xy, drift])
    basis, off = whole[known], at[known, 2] - gps_enu_m[known, 2]
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
    rest = (off - basis @ fit)[used]
    noise = float(np.sqrt((rest**2).sum() / free * alike(rest)))
    bowl, others = basis[used, 0], basis[used, 1:]
    apart = float(np.linalg.norm(bowl - others @ np.linalg.lstsq(others, bowl, rcond=None)[0]))
    if apart < 1e-6:
        return None
    few = float(student.ppf(norm.cdf(3), free)) / 3  # three errors of an estimate from few cameras happen more often
    doming = Doming(100 * float(fit[0]) / extent, 100 * few * noise / apart / extent)
    return AltitudeFit(doming, drift @ fit[-terms:] if terms else np.zeros(len(at)), noise)


def alike(errors: Float[np.ndarray, " n"]) -> float:
    """Return how many successive errors count for one, as they are alike: 1 + 2 sum of correlations (Sokal 1997, section 3).

    The sum ends where neighbours are no longer alike, for beyond it is noise.
    """
    errors, count = errors - errors.mean(), 1.0
    power = float((errors**2).sum())
    for lag in range(1, len(errors) // 3):
        correlation = float((errors[lag:] * errors[:-lag]).sum()) / power if power else 0.0
        if correlation <= _UNLIKE:
            break
        count += 2 * correlation
    return count


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
