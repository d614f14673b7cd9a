"""The paper's claims about its three edge cases, with the numbers of the study: a chart, and a sentence for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.studies.stability.findings import MethodRow, StabilityFindings

_BEST = "shared"  # the paper's choice
_COLOURS = {
    "sequence": "#b45309",
    "grid": "#be123c",
    "grid_any_angle": "#f472b6",
    "ray": "#7c3aed",
    "shared": "#15803d",
    "surface": "#0369a1",
}


@dataclass(frozen=True)
class Claim:
    """The paper's claim about a case (its section on clustering), and the way of grouping that it is about."""

    perturbation: str
    way: str
    words: str


CLAIMS = (
    Claim("abrupt turns", "sequence", "abrupt changes of course put photographs of different places into one group"),
    Claim("near cameras that look apart", "grid_any_angle", "cameras that stand near one another may look apart"),
    Claim("high buildings", "ray", "near high-rises, rays that meet the ground close by come from different sides"),
)


def rows_of(found: StabilityFindings, claim: Claim) -> dict[str, MethodRow]:
    """Return the rows of a case by way of grouping; none if the study was run without it."""
    return {row.method: row for row in found.rows if row.perturbation.name == claim.perturbation}


def sentences(found: StabilityFindings) -> list[str]:
    """Return a sentence for each case that was run: the paper's claim, and the doses and shares measured here."""
    told = []
    for claim in CLAIMS:
        rows = rows_of(found, claim)
        if claim.way in rows and _BEST in rows:
            told.append(f"The paper: {claim.words}. Here: {_broken(rows[claim.way])}; {_broken(rows[_BEST])}.")
    return told


def _broken(row: MethodRow) -> str:
    """Return the dose at which a way breaks, and its worst share of bad members."""
    unit, worst = row.perturbation.dose_unit, max(row.doses, key=lambda dose: dose.accuracy or 0.0)
    bad = f"{worst.accuracy or 0:.0%} of its members are bad at {worst.dose:g} {unit}"
    if row.breaking is None:
        return f"{row.method} never breaks (at most {worst.accuracy or 0:.0%} of its members are bad)"
    return f"{row.method} breaks at {row.breaking.dose:g} {unit} ({bad})"


def draw(found: StabilityFindings, path: Path | BytesIO) -> bool:
    """Write a PNG with a panel for each case, bad members against dose; return whether there was any case."""
    cases = [rows for claim in CLAIMS if (rows := rows_of(found, claim))]
    if not cases:
        return False
    figure = Figure(figsize=(5.4 * len(cases), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = [figure.add_subplot(1, len(cases), 1 + number) for number in range(len(cases))]
    for axes, rows in zip(panels, cases, strict=True):
        _panel(axes, list(rows.values()))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, frameon=False)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    return True


def _panel(axes: Axes, rows: Sequence[MethodRow]) -> None:
    """Draw the median over seeds, and the range of all seeds as a band."""
    perturbation = rows[0].perturbation
    for row in rows:
        colour = _COLOURS.get(row.method, "black")
        doses = [dose for dose in row.doses if dose.accuracy is not None]
        if not doses:
            continue
        spread = np.array([_range([r.accuracy for r in dose.results if r.accuracy is not None]) for dose in doses])
        at = [dose.dose for dose in doses]
        wide = 2.6 if row.method == _BEST else 1.6
        median = np.array([dose.accuracy for dose in doses], float)
        top = 3 if row.method == _BEST else 2  # several ways lie on one line: there, show the paper's choice
        axes.plot(at, median, "o-", color=colour, lw=wide, ms=4, label=row.method, zorder=top)
        axes.fill_between(at, *spread.T, color=colour, alpha=0.15, lw=0)
    axes.axhline(perturbation.judge.mark, color="#64748b", ls="--", lw=1, label="counts as broken")
    axes.set_title(perturbation.name, fontsize=11)
    axes.set(xlabel=perturbation.dose_unit, ylabel="bad members", ylim=(-0.03, 1.0))
    axes.yaxis.set_major_formatter(lambda share, _: f"{share:.0%}")
    axes.grid(alpha=0.2)


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
