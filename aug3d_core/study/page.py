"""A study as one HTML page that needs no network: what holds, the chart, the table, and what went wrong."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from aug3d_core.charts.html import duration, number, page, picture, table, tag
from aug3d_core.charts.story import GAINS
from aug3d_core.study.findings import Findings
from aug3d_core.study.statistics import Difference, Tested
from aug3d_core.study.table import Row

_LOOKS = {"holds": "ok", "does not hold": "refused", "not decided": "degraded"}


def write_page(found: Findings, chart: Path, out: Path) -> None:
    """Write the page; the chart goes inside it."""
    sections = [
        _header(found),
        *(tag("h2", chapter) + told for chapter, told in chapters(found, chart).items()),
        _cheap(found),
        _notes(found.rows),
        tag("h2", "How it was done"),
        _method(found),
    ]
    out.write_text(page(f"{found.scene}: {found.study.name} - aug3d", "".join(sections)), encoding="utf-8")


def chapters(found: Findings, chart: Path) -> dict[str, str]:
    """Return what the study tells, by chapter of the story."""
    said = "PSNR in dB. A difference is to the nearest row that has none; seconds are of one run's training and test."
    told = [
        _orderings(found.tested),
        tag("div", picture(chart, "PSNR of every arm, and paired differences"), class_="card"),
        tag("p", said),
        *(_part(part, found) for part in dict.fromkeys(row.arm.part for row in found.rows)),
    ]
    return {GAINS: "".join(told)}


def _header(found: Findings) -> str:
    facts = {
        "scene": found.scene,
        "preset": found.preset,
        "test photographs": str(found.test_photos),
        "seeds": str(found.seeds),
        "runs": str(len(found.results)),
        "of them failed": str(found.failed),
        **{name: number(value) for name, value in found.effort.items()},
    }
    line = "".join(tag("span", f"{name} {tag('b', escape(value))}") for name, value in facts.items())
    return tag("h1", escape(found.study.question)) + tag("div", line, class_="facts")


def _orderings(tested: Sequence[Tested]) -> str:
    rows = [
        (
            tag("span", escape(one.ordering.claim), style="white-space:normal"),
            "the paper's" if one.ordering.paper else "our own",
            tag("span", one.verdict, class_=_LOOKS[one.verdict]),
            "<br>".join(_told(difference) for difference in one.differences),
        )
        for one in tested
    ]
    return table(("statement", "whose", "on this scene", "difference (95 % interval)"), rows)


def _told(difference: Difference) -> str:
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


def _part(part: str, found: Findings) -> str:
    rows = [row for row in found.rows if row.arm.part == part]
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


def figures(row: Row) -> tuple[str, ...]:
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


def _cheap(found: Findings) -> str:
    rows = [(str(inputs), *(number(value) for value in answers.values())) for inputs, answers in found.cheap.items()]
    names = [name.replace("_", " ") for name in next(iter(found.cheap.values()), {})]
    said = tag("p", "The same test answered without a network, mean PSNR in dB:")
    return said + table(("input views", *names), rows, numeric=range(1, len(names) + 1)) if rows else ""


def _notes(rows: Sequence[Row]) -> str:
    told = [(row.arm.key, note) for row in rows for note in row.notes]
    if not told:
        return ""
    lines = "".join(tag("div", f"{tag('b', escape(arm))} {escape(note)}", class_="note") for arm, note in told)
    return tag("h2", "What went wrong, or is doubtful") + lines


def _method(found: Findings) -> str:
    spent = sum(result.seconds for result in found.results)
    said = (
        "Every run predicts the same held-out photographs from the same inputs, and is trained as long as every other. Best,"
        " low and average are over the test photographs of all seeds. Differences are paired, photograph by photograph and seed"
        " by seed; their intervals draw both anew (pigeonhole bootstrap), as wide as a t interval for so few photographs. An"
        " ordering is decided when the interval leaves zero out, for every pair that it names. It is one scene: another may"
        " answer otherwise."
    )
    return tag("p", escape(said)) + tag(
        "p", f"{duration(spent)} of training and testing on {escape(found.machine)}.", class_="dim"
    )
