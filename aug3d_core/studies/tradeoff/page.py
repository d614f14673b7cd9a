"""A study as a publication: what it costs, what it gains, what a scene needs, and how it was found."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from aug3d_core.report.front import draw
from aug3d_core.report.front_html import panel_html, script
from aug3d_core.report.html import duration, number, percent, spaced, table, tag
from aug3d_core.report.story import COSTS, GAINS, NEEDS
from aug3d_core.studies.common.page import notes
from aug3d_core.studies.common.publication import LoggedRun, Publication, logged
from aug3d_core.studies.tradeoff.arm import FACTORY, TradeoffResult
from aug3d_core.studies.tradeoff.chart import charts
from aug3d_core.studies.tradeoff.findings import (
    against_best,
    as_json,
    cache,
    crashes,
    decisions,
    search_against_grid,
)
from aug3d_core.studies.tradeoff.findings import table as score_table
from aug3d_core.studies.tradeoff.point import Point
from aug3d_core.studies.tradeoff.study import TradeoffFindings

# A chart is drawn as soon as it is read, so a column must have its width before the next chart: auto-fill, not auto-fit.
_CURVES = "grid-template-columns:repeat(auto-fill,minmax(min(100%,420px),1fr))"
_WIDE = {True: "", False: "grid-column:1/-1"}  # by whether each dot has its label beside it
_METHOD = (
    "Time is processor time, measured when an output was made: other work on the machine and outputs that were in the store"
    " do not change it. Stages that users do not need are left out: the town's photographs and the comparison with its truth."
    " Dots are medians over the seeds, small dots the seeds. Outstanding configurations of the factory's grid were repeated"
    " with every seed. The order was random. Bars at marked dots are 95 % intervals of the difference from the panel's best,"
    " over shared seeds and photographs; they may reach beyond the panel. Hollow dots were judged on other photographs and"
    " are not ranked; auto is compared with the best on the photographs that judged both. Pictures are compared at one size;"
    " from smaller working copies they are a little smoother."
)


def _size(found: TradeoffFindings, seeds: str) -> str:
    """Return how much was studied, for a study to take the place of one of its size only."""
    part = "chosen panels, " if found.in_part else "search alone, " if found.searched_only else ""
    return part + ("quick size" if found.quick else seeds)


def publication(found: TradeoffFindings, machine: str) -> Publication:
    """Return what the study publishes."""
    scene, own, state = found.scene.name, found.scene.own, cache(found.results)
    seeds = "one seed" if found.seeds == 1 else f"medians of up to {found.seeds} seeds"
    title = (
        f"{scene}, preset {own.preset}; {seeds}; {state['found_made']} of {state['outputs']} outputs were in the store\n"
        f"{' '.join(own.overrides)}\n{machine}\n"
        "orange: as the scene has it, triangle: auto, star: the cheapest that is enough, hollow: another test"
    )
    return Publication(
        place=scene,
        label="tradeoff",
        title=f"{scene}: speed against accuracy",
        question="What does accuracy cost?",
        about=f"{scene}: time against accuracy, {_size(found, seeds)}",
        data=as_json(found, machine),
        table=score_table(found),
        draw=lambda path: draw(charts(found), title, path),
        facts={
            "scene": scene,
            "preset": own.preset,
            "runs": str(len(found.results)),
            "runs without a figure": str(sum(result.accuracy is None for result in found.results)),
            "seeds": str(found.seeds),
            "test photographs": str(found.test_photos),
            "enough": "-" if found.target_db is None else f"{found.target_db:.2f} dB",
        },
        chapters=lambda _chart: chapters(found),
        after=notes(
            (result.cell.name, note)
            for result in found.results
            for note in [*([result.failure] if result.failure else []), *result.notes]
        ),
        method=f"{_METHOD} {state['found_made']} of {state['outputs']} outputs existed before the study.",
        cost=machine,
        script=script(),
        tags={"scene": scene, "preset": own.preset, "study": "tradeoff"},
        params={"seeds": found.seeds, "quick": found.quick, "settings": " ".join(own.overrides)},
        metrics={
            "runs": len(found.results),
            "crashes": crashes(found),
            **against_best(found),
            **search_against_grid(found),
        },
        cells=[_logged(result) for result in found.results],
    )


def _logged(result: TradeoffResult) -> LoggedRun:
    measured = {
        name: getattr(result, name) for name in ("accuracy", "size_bytes", "cpu_seconds", "seconds", "peak_mib")
    }
    tags = {"failure": result.failure, "mark": result.arm.mark}
    return logged(result, {"panel": result.arm.panel, "label": result.arm.label}, measured, tags)


def chapters(found: TradeoffFindings) -> dict[str, str]:
    """Return the results, by chapter of the story."""
    drawn = {
        panel.title: tag("div", panel_html(panel), class_="card", style=_WIDE[panel.labelled])
        for panel in charts(found)
    }
    whole = drawn.pop(FACTORY, "")
    cards = "".join(drawn.values())
    settings = tag("h3", "Every setting") + tag("div", cards, class_="curves", style=_CURVES) if cards else ""
    if not whole:  # only chosen panels
        return {GAINS: settings}
    gains = [
        tag("p", escape(in_words(found))),
        whole,
        settings,
        tag("h3", "The cheapest configuration, without trying everything"),
        _search(found),
    ]
    return {COSTS: _shares(found), GAINS: "".join(gains), NEEDS: _auto(found)}


def _named(found: TradeoffFindings) -> Mapping[str, Point]:
    """Return the configurations that the page describes, by their role."""
    own = next((point for point in found.factory if point.arm.mark == "preset"), None)
    named = {
        "as the scene has it": own,
        "best tried": found.best,
        "cheapest that is enough": found.chosen,
        "auto": found.auto,
    }
    return {name: point for name, point in named.items() if point is not None}


def _shares(found: TradeoffFindings) -> str:
    """Return a table of processor seconds by stage."""
    named = _named(found)
    stages = list(dict.fromkeys(stage for point in named.values() for stage in point.results[0].costs))
    rows = []
    for stage in stages:
        costs = [point.results[0].costs.get(stage, 0.0) for point in named.values()]
        totals = [point.results[0].cpu_seconds or 1.0 for point in named.values()]
        shares = [f"{cost:,.0f} s · {percent(cost / total)}" for cost, total in zip(costs, totals, strict=True)]
        rows.append((spaced(stage), *shares))
    totals = [tag("b", duration(point.results[0].cpu_seconds)) for point in named.values()]
    return table(("stage", *named), [*rows, (tag("b", "all"), *totals)], numeric=range(1, len(named) + 1))


def in_words(found: TradeoffFindings) -> str:
    """Return the result in a sentence or two."""
    best, chosen = found.best, found.chosen
    if best is None:
        return "No configuration of the factory has a score."
    said = (
        f"The best that was tried, {best.arm.label}, reaches {_db(best.accuracy)} dB in {duration(best.cpu_seconds)}."
    )
    if chosen is None:
        return f"{said} Nothing reaches {_db(found.target_db)} dB."
    return (
        f"{said} {_db(found.target_db)} dB are enough; the cheapest that reaches it, {chosen.arm.label}, "
        f"takes {duration(chosen.cpu_seconds)}: {percent(chosen.cpu_seconds / (best.cpu_seconds or 1.0))} of that."
    )


def _search(found: TradeoffFindings) -> str:
    if found.search is None or found.search.found is None:
        return tag("p", "Nothing has a score, so there was nothing to search for.")
    ended, ratios = found.search.found, search_against_grid(found)
    verb = "ended at" if found.search.reached else "did not reach the target; its best is"
    said = (
        f"Successive halving towards {_db(found.search.target_db)} dB {verb} {', '.join(ended.settings)}, "
        f"{ended.steps} steps: {_db(ended.tried.psnr_db)} dB in {duration(ended.tried.cost_s)}. "
        f"It tried {len(found.search.trials)} configurations for {duration(found.search.spent_s)}, "
        f"{number(ratios['search_cost_ratio'], 3)} times what the cheapest costs"
    )
    regret = ratios["search_regret_db"]
    if regret is not None:
        dearer = number(ratios["search_found_ratio"], 3)
        said += f"; what it ended at costs {dearer} times that, and is {regret:.2f} dB below it"
    return tag("p", escape(f"{said}."))


def _auto(found: TradeoffFindings) -> str:
    auto, ratios = found.auto, against_best(found)
    if auto is None:
        return ""
    beside, share = _beside_the_best(ratios), ratios["auto_time_ratio"]
    if not beside or share is None:
        why = auto.results[0].failure or "its test shares too few photographs with the others'"
        return tag("p", escape(f"auto cannot be compared: {why}.")) + _decisions(found)
    said = f"auto reaches {_db(auto.accuracy)} dB in {duration(auto.cpu_seconds)}: {beside}, in {percent(share)} of its time."
    if found.quick:
        said += " Everything was trained for seconds: full training may give another result."
    return tag("p", escape(said)) + _decisions(found)


def _beside_the_best(ratios: Mapping[str, float | None]) -> str:
    """Return how far `auto` is below the best, "" where that is not known."""
    regret, low, high = (ratios[f"auto_regret_{name}db"] for name in ("", "low_", "high_"))
    if regret is None:
        return ""
    sign, where = (-1, "above") if regret < 0 else (1, "below")
    ends = sorted(sign * end for end in (low, high) if end is not None)
    between = f" [{ends[0]:.2f}, {ends[1]:.2f}]" if ends else ""
    return f"{sign * regret:.2f} dB {where} the best that was tried{between}"


def _decisions(found: TradeoffFindings) -> str:
    heads = ("setting", "value", "measured", "rule", "saves", "may cost")
    names = ("field", "value", "measured", "rule", "saves", "costs")
    rows = [
        tuple(
            tag("span", number(row[name]) if name == "value" else escape(str(row[name])), style="white-space:normal")
            for name in names
        )
        for row in decisions(found)
    ]
    return table(heads, rows) if rows else ""


def _db(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
