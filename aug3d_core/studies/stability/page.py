"""The study as a publication: silent failures, the map, the dose at which each method breaks, and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from html import escape
from io import BytesIO
from pathlib import Path

from aug3d_core.report.html import data_uri, duration, number, picture, table, tag
from aug3d_core.report.story import BREAKS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.publication import LoggedRun, Publication, logged
from aug3d_core.studies.stability import edge_story
from aug3d_core.studies.stability.cell import StabilityResult
from aug3d_core.studies.stability.findings import Dose, MethodRow, StabilityFindings, as_json, cell_table
from aug3d_core.studies.stability.map import draw
from aug3d_core.studies.stability.pictures import picture_of

NAME = "stability"
QUESTION = "Where does each method break, and does the factory notice?"
_LOOKS = {"ok": "ok", "degraded": "degraded", "refused": "refused", "crash": "refused"}
_PICTURE_PX = 560
_NOTES = 3
_LONGEST = 4000  # characters of a tag in MLflow
_METHOD = (
    "Every cell is a run of the factory's own stages on a small town whose truth is known, with one thing made worse by a"
    " dose; or a computation on an exactly known world, which needs no stage. Marks were set before anything was measured,"
    " except that of boxes among bare trees, which was set afterwards. A method is broken at a dose when at least half of its"
    " seeds miss the mark or give no figure. A figure is the median of the seeds; no figure is the worst. A failure is silent"
    " when a cell is broken and no stage from the damage on reported more than ok. The comparison with the town's truth does"
    " not count, since users do not have it. Methods that the factory never uses there, and that are shown for comparison,"
    " cannot be silent. A cell above the dose that breaks a method is judged by itself: where it holds, ok is correct."
)


def publication(store: Store, found: StabilityFindings) -> Publication:
    """Return what the study publishes."""
    counts = {
        "cells": len(found.results),
        "silent_failures": len(found.silent),
        "crashes": len(found.crashes),
        "false_alarms": len(found.false_alarms),
    }
    cost = (
        f"{duration(found.cpu_seconds)} of processor time, {duration(found.seconds)} of wall time, on {found.machine}."
    )
    return Publication(
        place=NAME,
        label=found.size,
        title="Where methods break",
        question=QUESTION,
        about=f"stability, {found.size} size",
        data=as_json(found),
        table=cell_table(found),
        draw=partial(draw, found),
        facts={
            "size": found.size,
            "seeds": str(found.seeds),
            **{name.replace("_", " "): number(count) for name, count in counts.items()},
        },
        before="".join(
            [
                *_alarms("Silent failures: broken, and the factory reported ok", found.silent),
                *_alarms("Crashes: ended in a way that no input should cause", found.crashes),
            ]
        ),
        chapters=lambda chart: {BREAKS: _breaks(found, chart)},
        after=_pictures(store, found.rows),
        method=_METHOD,
        cost=cost,
        tags={"study": NAME},
        params={"seeds": found.seeds, "size": found.size},
        metrics={**counts, "cpu_seconds": found.cpu_seconds},
        cells=[_logged(result) for result in found.results],
    )


def _logged(result: StabilityResult) -> LoggedRun:
    arm = result.arm
    return logged(
        result,
        {"perturbation": arm.perturbation.name, "dose": arm.dose, "method": arm.method},
        {"accuracy": result.accuracy, "broken": int(result.broken), "silent": int(result.silent)},
        {"state": result.state, "said": " | ".join((result.failure, *result.notes))[:_LONGEST]},
        failed=result.state == "crash",
    )


def _breaks(found: StabilityFindings, chart: Path) -> str:
    parts = dict.fromkeys(row.perturbation.part for row in found.rows)
    sections = [
        tag("div", picture(chart, "Every method at every dose", 2400), class_="card"),
        *_paper(found),
        *(_breaking(part, found.rows) for part in parts),
    ]
    return "".join(sections)


def _pictures(store: Store, rows: Sequence[MethodRow]) -> str:
    explained = (
        "Each method at the first dose at which it is broken, beside the harmless dose; and the factory's report."
    )
    parts = dict.fromkeys(row.perturbation.part for row in rows)
    shown = "".join(html for part in parts for html in _looks(store, part, rows))
    return tag("h2", "Pictures of failures") + tag("p", explained) + shown


def _alarms(title: str, results: Sequence[StabilityResult]) -> Iterable[str]:
    if not results:
        return
    yield tag("h2", title)
    for result in results:
        judge = result.arm.perturbation.judge
        said = f"{judge.name} {number(result.accuracy)}, mark {judge.mark:g}" if not result.failure else result.failure
        yield tag("div", f"{tag('b', escape(result.cell.name))} {escape(said)}", class_="note failure")


def _paper(found: StabilityFindings) -> Iterable[str]:
    chart = BytesIO()
    if not edge_story.draw(found, chart):
        return
    yield tag("h2", "The paper's edge cases of grouping, with numbers")
    caption = "Members that see almost nothing of their group's centre, by dose; bands: all seeds"
    shown = f'<img src="{data_uri("image/png", chart.getvalue())}" alt="{escape(caption)}">'
    said = "".join(tag("li", escape(sentence)) for sentence in edge_story.sentences(found))
    yield tag("div", tag("figure", shown + tag("figcaption", escape(caption))) + tag("ul", said), class_="card")


def _breaking(part: str, rows: Sequence[MethodRow]) -> str:
    cells = [
        (
            escape(row.perturbation.name),
            escape(row.method),
            escape(row.perturbation.judge.name),
            f"{row.perturbation.judge.mark:g}",
            number(row.doses[0].accuracy, 3),
            _dose(row, row.breaking),
            _state(row, row.breaking),
            _dose(row, row.noticed),
        )
        for row in rows
        if row.perturbation.part == part
    ]
    heads = (
        "perturbation",
        "method",
        "figure",
        "mark",
        "harmless dose",
        "breaks at",
        "state there",
        "first reported at",
    )
    return tag("h3", escape(part)) + table(heads, cells, numeric=(3, 4))


def _dose(row: MethodRow, dose: Dose | None) -> str:
    return "never" if dose is None else f"{dose.dose:g} {escape(row.perturbation.dose_unit)}"


def _state(row: MethodRow, dose: Dose | None) -> str:
    if dose is None:
        return "-"
    if dose.silent:
        return tag("span", "silent", class_="refused")
    if row.method in row.perturbation.compared:
        return "for comparison"
    return tag("span", dose.state, class_=_LOOKS[dose.state])


def _looks(store: Store, part: str, rows: Sequence[MethodRow]) -> Iterable[str]:
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


def _figure(store: Store, row: MethodRow, dose: Dose) -> Iterable[str]:
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
