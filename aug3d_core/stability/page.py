"""The study as one HTML page that needs no network: is anything silent, the map, where each method breaks, and how it looks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from pathlib import Path

from aug3d_core.charts.html import data_uri, duration, number, page, picture, table, tag
from aug3d_core.charts.story import BREAKS
from aug3d_core.stability import edge_story
from aug3d_core.stability.cell import Result
from aug3d_core.stability.findings import Dose, Findings, Row
from aug3d_core.stability.pictures import picture_of
from aug3d_core.store.store import Store

_LOOKS = {"ok": "ok", "degraded": "degraded", "refused": "refused", "crash": "refused"}
_PICTURE_PX = 560
_NOTES = 3


def write_page(store: Store, found: Findings, chart: Path, out: Path) -> None:
    """Write the page; all pictures go inside it."""
    parts = list(dict.fromkeys(row.perturbation.part for row in found.rows))
    sections = [
        _header(found),
        *_alarms("Silent failures: broken, and the factory said ok", found.silent),
        *_alarms("Crashes: ended as no photograph should make it end", found.crashes),
        *(tag("h2", chapter) + told for chapter, told in chapters(found, chart).items()),
        tag("h2", "What it looks like"),
        tag(
            "p",
            "Each method at the first dose at which it is broken, beside the harmless dose; and what the factory said.",
        ),
        *(html for part in parts for html in _looks(store, part, found.rows)),
        tag("h2", "How it was done"),
        _method(found),
    ]
    out.write_text(page("Where methods break - aug3d", "".join(sections)), encoding="utf-8")


def chapters(found: Findings, chart: Path) -> dict[str, str]:
    """Return what the study tells, by chapter of the story."""
    parts = dict.fromkeys(row.perturbation.part for row in found.rows)
    told = [
        tag("div", picture(chart, "Every method at every dose", 2400), class_="card"),
        *_paper(found),
        *(_breaking(part, found.rows) for part in parts),
    ]
    return {BREAKS: "".join(told)}


def _header(found: Findings) -> str:
    facts = {
        "size": found.size,
        "cells": number(len(found.results)),
        "seeds": str(found.seeds),
        "silent failures": str(len(found.silent)),
        "crashes": str(len(found.crashes)),
        "alarms without cause": str(len(found.false_alarms)),
    }
    line = "".join(tag("span", f"{name} {tag('b', escape(value))}") for name, value in facts.items())
    return tag("h1", "Where does each method break, and does the factory notice?") + tag("div", line, class_="facts")


def _alarms(title: str, results: Sequence[Result]) -> Iterable[str]:
    if not results:
        return
    yield tag("h2", title)
    for result in results:
        judge = result.cell.perturbation.judge
        said = f"{judge.name} {number(result.accuracy)}, mark {judge.mark:g}" if not result.failure else result.failure
        yield tag("div", f"{tag('b', escape(result.cell.name))} {escape(said)}", class_="note failure")


def _paper(found: Findings) -> Iterable[str]:
    chart = BytesIO()
    if not edge_story.draw(found, chart):
        return
    yield tag("h2", "The paper's edge cases of grouping, with numbers")
    caption = "Members that see next to nothing of their group's centre, against the dose; bands: all seeds"
    shown = f'<img src="{data_uri("png", chart.getvalue())}" alt="{escape(caption)}">'
    said = "".join(tag("li", escape(sentence)) for sentence in edge_story.sentences(found))
    yield tag("div", tag("figure", shown + tag("figcaption", escape(caption))) + tag("ul", said), class_="card")


def _breaking(part: str, rows: Sequence[Row]) -> str:
    cells = [
        (
            escape(row.perturbation.name),
            escape(row.method),
            escape(row.perturbation.judge.name),
            f"{row.perturbation.judge.mark:g}",
            number(row.doses[0].accuracy, 3),
            _dose(row, row.breaking, "never"),
            _state(row, row.breaking),
            _dose(row, row.noticed, "never"),
        )
        for row in rows
        if row.perturbation.part == part
    ]
    heads = ("perturbation", "method", "figure", "mark", "undisturbed", "breaks at", "and then is", "first noticed at")
    return tag("h3", escape(part)) + table(heads, cells, numeric=(3, 4))


def _dose(row: Row, dose: Dose | None, never: str) -> str:
    return never if dose is None else f"{dose.dose:g} {escape(row.perturbation.dose_unit)}"


def _state(row: Row, dose: Dose | None) -> str:
    if dose is None:
        return "-"
    if dose.silent:
        return tag("span", "silent", class_="refused")
    if row.method in row.perturbation.compared:
        return "only compared"
    return tag("span", dose.state, class_=_LOOKS[dose.state])


def _looks(store: Store, part: str, rows: Sequence[Row]) -> Iterable[str]:
    mine = [row for row in rows if row.perturbation.part == part]
    yield tag("h3", escape(part))
    for name in dict.fromkeys(row.perturbation.name for row in mine):
        alike = [row for row in mine if row.perturbation.name == name]
        judge = alike[0].perturbation.judge
        told = f"{alike[0].perturbation.what} Broken when {judge.why}."
        figures = [*_figure(store, alike[0], alike[0].doses[0])]
        figures += [html for row in alike if row.breaking for html in _figure(store, row, row.breaking)]
        yield tag("div", tag("h3", escape(name)) + tag("p", escape(told)) + _grid(figures), class_="card stage")


def _grid(figures: Sequence[str]) -> str:
    return tag("div", "".join(figures), class_="pictures")


def _figure(store: Store, row: Row, dose: Dose) -> Iterable[str]:
    result = next((r for r in dose.results if r.broken == dose.broken), dose.results[0])
    found = picture_of(store, result)
    said = "; ".join(result.notes[:_NOTES]) or "nothing"
    text = (
        f"{row.method}, {dose.dose:g} {row.perturbation.dose_unit}: {row.perturbation.judge.name}"
        f" {number(result.accuracy, 3)}. The factory: {result.state}; {said}"
    )
    if found is None:
        yield tag("div", escape(text), class_="note failure" if result.broken else "note")
    else:
        yield picture(found[0], f"{text} ({found[1]})", _PICTURE_PX)


def _method(found: Findings) -> str:
    said = (
        "Every cell is a run of the factory's own stages on a small town whose truth is known, with one thing made worse by a"
        " dose; or a world known exactly, where no stage is needed. Marks were set before anything was measured, but that of"
        " boxes among bare trees, which was set after they were seen. A method is broken at a dose when half of its seeds or"
        " more miss the mark or give nothing; a figure is the median of the seeds, where giving nothing is worst. A failure is"
        " silent when a cell is broken and no stage from the damage on reported more than ok; comparison with the town's truth"
        " does not count, for users have none. Nor can methods be silent that the factory never uses there and that are shown"
        " to compare. A cell above the dose that breaks a method is judged for itself: where it holds, ok is true."
    )
    cost = (
        f"{duration(found.cpu_seconds)} of processor time, {duration(found.seconds)} of wall time, on {found.machine}."
    )
    return tag("p", escape(said)) + tag("p", escape(cost), class_="dim")
