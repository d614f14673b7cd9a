"""A table as a publication: its orderings, chart, rows and failures."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from aug3d_core.report.html import duration, number, picture, table, tag
from aug3d_core.report.story import GAINS
from aug3d_core.studies.common.page import notes
from aug3d_core.studies.common.publication import Publication, logged
from aug3d_core.studies.paper.chart import draw
from aug3d_core.studies.paper.findings import PaperFindings, as_json
from aug3d_core.studies.paper.orderings import Difference, JudgedOrdering
from aug3d_core.studies.paper.rows import ArmRow

_LOOKS = {"holds": "ok", "does not hold": "refused", "not decided": "degraded"}
_METHOD = (
    "Every run predicts the same held-out photographs from the same inputs, and all are trained for the same number of steps."
    " Best, low and average are over the test photographs of all seeds that have a score in every fold."
    " Differences are paired by photograph and seed. Their intervals resample both (pigeonhole bootstrap) and are as wide as"
    " a t interval for so few photographs. An ordering is decided if the interval of every pair that it names excludes"
    " zero. This is one scene: the result may differ on another."
)


def publication(found: PaperFindings) -> Publication:
    """Return what the study publishes."""
    counts = {"runs": len(found.results), "failed_runs": found.failed, "test_photos": found.test_photos}
    spent = sum(result.seconds for result in found.results)
    return Publication(
        place=found.scene,
        label=found.table.name,
        title=f"{found.scene}: {found.table.name}",
        question=found.table.question,
        about=f"{found.scene}: {found.table.name}, {found.seeds} seeds",
        data=as_json(found),
        table=found.scores,
        draw=partial(draw, found),
        facts={
            "scene": found.scene,
            "preset": found.preset,
            "test photographs": str(found.test_photos),
            "seeds": str(found.seeds),
            "runs": str(len(found.results)),
            "failed runs": str(found.failed),
            **{name: number(value) for name, value in found.effort.items()},
        },
        chapters=lambda chart: {GAINS: _gains(found, chart)},
        after=_cheap(found) + notes((row.arm.name, note) for row in found.rows for note in row.notes),
        method=_METHOD,
        cost=f"{duration(spent)} of training and test on {found.machine}.",
        tags={"scene": found.scene, "preset": found.preset, "study": found.table.name},
        params={"seeds": found.seeds, **{name.replace(" ", "_"): value for name, value in found.effort.items()}},
        metrics=counts,
        cells=[
            logged(result, {"arm": result.arm.name, "fold": result.cell.fold, **result.arm.labels})
            for result in found.results
        ],
    )


def _gains(found: PaperFindings, chart: Path) -> str:
    explained = (
        "PSNR in dB. A difference is to the nearest row that has none. Seconds are of the training and test of one run."
    )
    sections = [
        _orderings(found.orderings),
        tag("div", picture(chart, "PSNR of every arm, and paired differences"), class_="card"),
        tag("p", explained),
        *(_part(part, rows) for part, rows in found.parts.items()),
    ]
    return "".join(sections)


def _orderings(judged: Sequence[JudgedOrdering]) -> str:
    rows = [
        (
            tag("span", escape(one.ordering.claim), style="white-space:normal"),
            "the paper" if one.ordering.paper else "our question",
            tag("span", one.verdict, class_=_LOOKS[one.verdict]),
            "<br>".join(_compared(difference) for difference in one.differences),
        )
        for one in judged
    ]
    return table(("statement", "from", "on this scene", "difference (95 % interval)"), rows)


def _compared(difference: Difference) -> str:
    return f"{difference_text(difference)} over {escape(difference.second)}"


def difference_text(difference: Difference | None) -> str:
    """Return a difference with its interval as people read it."""
    if difference is None:
        return ""
    if difference.mean is None:
        return "no run of both"
    if difference.interval is None:
        return f"{difference.mean:+.2f} dB (no interval: one seed or one photograph)"
    low, high = difference.interval
    return f"{difference.mean:+.2f} dB [{low:+.2f}, {high:+.2f}]"


def _part(part: str, rows: Sequence[ArmRow]) -> str:
    labels = list(dict.fromkeys(label for row in rows for label in row.arm.labels))
    cells = [(*(escape(row.label(label)) for label in labels), *map(escape, figures(row))) for row in rows]
    heads = (*labels, *FIGURES)
    return tag("h3", escape(part)) + table(heads, cells, numeric=range(len(labels), len(heads)))


FIGURES = (
    "groups",
    "virtual views",
    "best",
    "low",
    "average",
    "SSIM",
    "difference",
    "failed",
    "seconds",
    "CPU seconds",
)


def figures(row: ArmRow) -> tuple[str, ...]:
    """Return the figures of a row as text, in the order of FIGURES."""
    return (
        number(row.groups),
        number(row.virtual_views),
        *(("-" if value is None else f"{value:.2f}") for value in (row.best, row.low, row.average)),
        "-" if row.ssim is None else f"{row.ssim:.3f}",
        difference_text(row.against),
        f"{row.failed} of {row.runs}",
        *(("-" if value is None else f"{value:.0f}") for value in (row.seconds, row.cpu_seconds)),
    )


def _cheap(found: PaperFindings) -> str:
    rows = [(str(inputs), *(number(value) for value in answers.values())) for inputs, answers in found.cheap.items()]
    names = [name.replace("_", " ") for name in next(iter(found.cheap.values()), {})]
    said = tag("p", "The same test answered without a network, mean PSNR in dB:")
    return said + table(("input views", *names), rows, numeric=range(1, len(names) + 1)) if rows else ""
