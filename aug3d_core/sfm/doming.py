"""Measure doming: the bend of a flight that distortion and depth trade for each other, against the altitudes of GPS.

Altitudes are a barometer's: one that rises and falls by 4 m over a flight of 300 m looks like a bend of 0.4 %. So what varies
slowly along the flight is told apart, and errors of neighbours that are alike count for fewer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm
from scipy.stats import t as student

from aug3d_core.geometry.robust import spread

# A bowl of 1 % of the extent leans at its rim by 4 %, 2.3 degrees: more than the 1.5 degrees of doubt about the vertical
# at which `align` stops believing GPS altitudes. The town, unbent, has some hundredths of a percent.
MOST_PCT = 1.0

FEWEST = 8
_DRIFT_TERMS, _DRIFT_FROM = 3, 20  # a cubic along the flight, where so many altitudes tell it from a bend
_UNLIKE = 0.05  # correlation at which errors no longer count as alike
_ROUNDS = 30
_SURE = 3.0  # times its error


@dataclass(frozen=True)
class Doming:
    """Height of the bowl over the flight's extent, and its standard error, in percent of that extent; what told of it.

    The error is larger where few cameras tell it, so that three of it are passed by chance once in 370 flights, however few.
    """

    pct: float
    sigma_pct: float
    told_by: str = "GPS altitudes"

    @property
    def sure(self) -> bool:
        """Whether noise does not explain it."""
        return abs(self.pct) > _SURE * self.sigma_pct

    @property
    def flagged(self) -> bool:
        """Whether the bend is too large to ignore, and sure."""
        return abs(self.pct) > MOST_PCT and self.sure

    def contradicts(self, other: Doming) -> bool:
        """Whether the two cannot both be right."""
        return abs(self.pct - other.pct) > _SURE * float(np.hypot(self.sigma_pct, other.sigma_pct))

    @property
    def notes(self) -> tuple[str, ...]:
        """What to tell the user of it: nothing, if it is not flagged."""
        if not self.flagged:
            return ()
        return (
            f"the reconstruction is bent like a {'bowl' if self.pct > 0 else 'dome'} by {abs(self.pct):.1f} % of the flight's "
            f"extent, as {self.told_by} tell; photographs at an angle, or a second height, would hold it",
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
    if known.sum() < FEWEST:
        return None
    middle = at[known, :2].mean(axis=0)
    extent = float(np.linalg.norm(np.ptp(at[known, :2], axis=0)))
    if extent == 0:
        return None
    xy = (at[:, :2] - middle) / (extent / 2)
    along = np.linspace(-1, 1, len(at))
    terms = _DRIFT_TERMS if known.sum() >= _DRIFT_FROM else 0
    drift = np.power.outer(along, np.arange(1, terms + 1))
    whole = np.column_stack([(xy**2).sum(axis=1), np.ones(len(at)), xy, drift])
    found = seek(whole[known], at[known, 2] - gps_enu_m[known, 2], 1e-9 * extent)
    if found is None:
        return None
    doming = Doming(100 * found.terms[0] / extent, 100 * found.sigma / extent)
    return AltitudeFit(doming, drift @ found.terms[4:], found.noise)


@dataclass(frozen=True)
class Sought:
    """A robust fit: the term of each column, the standard error of the first, and the noise as if values were independent."""

    terms: Float[np.ndarray, " m"]
    sigma: float
    noise: float


def seek(basis: Float[np.ndarray, "n m"], values: Float[np.ndarray, " n"], least: float) -> Sought | None:
    """Fit values by the columns, so that wild ones hardly count; None where the first column is not told from the others.

    values: in the order of capture. least: noise that is none.
    """
    fit = np.linalg.lstsq(basis, values, rcond=None)[0]
    for _ in range(_ROUNDS):  # towards least absolute deviations, which wild values hardly move
        weight = 1 / np.maximum(np.abs(values - basis @ fit), 1e3 * least)
        fit = np.linalg.lstsq(basis * weight[:, None] ** 0.5, values * weight**0.5, rcond=None)[0]
    # The fit goes through as many values as it has terms; what these leave says nothing of the noise (Holland, Welsch 1977)
    left = np.sort(np.abs(values - basis @ fit))[basis.shape[1] :]
    if not len(left):
        return None
    used = np.abs(values - basis @ fit) <= 4 * max(spread(left), least)
    free = int(used.sum()) - basis.shape[1]
    if free < 1:
        return None
    fit = np.linalg.lstsq(basis[used], values[used], rcond=None)[0]
    rest = (values - basis @ fit)[used]
    noise = float(np.sqrt((rest**2).sum() / free * alike(rest)))
    sought, others = basis[used, 0], basis[used, 1:]
    apart = float(np.linalg.norm(sought - others @ np.linalg.lstsq(others, sought, rcond=None)[0]))
    if apart <= 1e-6 * float(np.linalg.norm(sought)):
        return None
    few = float(student.ppf(norm.cdf(3), free)) / 3  # three errors of an estimate from few happen more often
    return Sought(fit, few * noise / apart, noise)


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
