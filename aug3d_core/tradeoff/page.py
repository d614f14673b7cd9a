"""A study as one HTML page that needs no network: what it costs, what it gains, what a scene needs, and how it was found."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from aug3d_core.charts.front_html import panel_html, script
from aug3d_core.charts.html import duration, number, page, percent, spaced, table, tag
from aug3d_core.charts.story import COSTS, GAINS, NEEDS
from aug3d_core.tradeoff.arm import FACTORY
from aug3d_core.tradeoff.chart import charts
from aug3d_core.tradeoff.findings import against_best, cache, decisions, search_against_grid
from aug3d_core.tradeoff.point import Point
from aug3d_core.tradeoff.study import Studied

# A chart is drawn as soon as it is read, so a column has its width before the next chart is there: auto-fill, not auto-fit.
_CURVES = "grid-template-columns:repeat(auto-fill,minmax(min(100%,420px),1fr))"
_WIDE = {True: "", False: "grid-column:1/-1"}  # by whether each dot has its label beside it


def write_page(found: Studied, machine: str, out: Path) -> None:
    """Write the page with its charts inside it."""
    sections = [
        _header(found),
        *(tag("h2", chapter) + told for chapter, told in chapters(found).items()),
        _notes(found),
        tag("h2", "How it was done"),
        _method(found, machine),
    ]
    out.write_text(
        page(f"{found.scene.name}: speed against accuracy - aug3d", "".join(sections), script()), encoding="utf-8"
    )


def chapters(found: Studied) -> dict[str, str]:
    """Return what the study tells, by chapter of the story."""
    drawn = {
        panel.title: tag("div", panel_html(panel), class_="card", style=_WIDE[panel.labelled])
        for panel in charts(found)
    }
    whole = drawn.pop(FACTORY, "")
    cards = "".join(drawn.values())
    settings = tag("h3", "Every setting") + tag("div", cards, class_="curves", style=_CURVES) if cards else ""
    if not whole:  # chosen panels alone
        return {GAINS: settings}
    gains = [
        tag("p", escape(in_words(found))),
        whole,
        settings,
        tag("h3", "The cheapest configuration, without trying everything"),
        _search(found),
    ]
    return {COSTS: _shares(found), GAINS: "".join(gains), NEEDS: _auto(found)}


def _header(found: Studied) -> str:
    facts = {
        "scene": found.scene.name,
        "preset": found.scene.own.preset,
        "runs": str(len(found.results)),
        "of them without a figure": str(sum(result.accuracy is None for result in found.results)),
        "seeds": str(found.seeds),
        "test photographs": str(found.test_photos),
        "enough": "-" if found.target_db is None else f"{found.target_db:.2f} dB",
    }
    line = "".join(tag("span", f"{name} {tag('b', escape(value))}") for name, value in facts.items())
    return tag("h1", "What does accuracy cost?") + tag("div", line, class_="facts")


def _named(found: Studied) -> Mapping[str, Point]:
    """Return the configurations that the page tells of, by what they are."""
    own = next((point for point in found.factory if point.arm.mark == "preset"), None)
    named = {
        "as the scene has it": own,
        "best tried": found.best,
        "cheapest that is enough": found.chosen,
        "auto": found.auto,
    }
    return {name: point for name, point in named.items() if point is not None}


def _shares(found: Studied) -> str:
    """Return the table of processor seconds, stage by stage."""
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


def in_words(found: Studied) -> str:
    """Say what was found in a sentence or two."""
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


def _search(found: Studied) -> str:
    if found.search is None or found.search.found is None:
        return tag("p", "Nothing has a score, so there was nothing to look for.")
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


def _auto(found: Studied) -> str:
    auto, ratios = found.auto, against_best(found)
    if auto is None:
        return ""
    beside, share = _beside_the_best(ratios), ratios["auto_time_ratio"]
    if not beside or share is None:
        why = auto.results[0].trial.failure or "its test has too few photographs in common with the others'"
        return tag("p", escape(f"auto cannot be compared: {why}.")) + _decisions(found)
    said = f"auto reaches {_db(auto.accuracy)} dB in {duration(auto.cpu_seconds)}: {beside}, in {percent(share)} of its time."
    if found.quick:
        said += " Everything was trained for seconds, to have a look: neither says what full training would."
    return tag("p", escape(said)) + _decisions(found)


def _beside_the_best(ratios: Mapping[str, float | None]) -> str:
    """Say how far `auto` is below the best, nothing where that is not known."""
    regret, low, high = (ratios[f"auto_regret_{name}db"] for name in ("", "low_", "high_"))
    if regret is None:
        return ""
    sign, where = (-1, "above") if regret < 0 else (1, "below")
    ends = sorted(sign * end for end in (low, high) if end is not None)
    between = f" [{ends[0]:.2f}, {ends[1]:.2f}]" if ends else ""
    return f"{sign * regret:.2f} dB {where} the best that was tried{between}"


def _decisions(found: Studied) -> str:
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


def _notes(found: Studied) -> str:
    told = dict.fromkeys(
        (result.name, said)
        for result in found.results
        for said in [*([result.trial.failure] if result.trial.failure else []), *result.notes]
    )
    if not told:
        return ""
    lines = [tag("div", f"{tag('b', escape(name))} {escape(said)}", class_="note") for name, said in told]
    return tag("h2", "What went wrong, or is doubtful") + tag(
        "details", tag("summary", f"{len(lines)} notes") + "".join(lines)
    )


def _method(found: Studied, machine: str) -> str:
    state = cache(found.results)
    said = (
        "Time is processor time, of the run that made an output, whenever that was: other work on the machine, and finding an"
        " output made, change nothing in it. What users do not pay for, the town's photographs and the comparison with"
        " its truth, is left out. Dots are medians over the seeds, small dots the seeds; what stands out in the factory's"
        " grid was repeated with every seed. The order was drawn by lot. Bars at marked dots are 95 % intervals of how far"
        " they are below the panel's best, over seeds and photographs that judged both; they may reach beyond the panel."
        " Hollow dots were judged on others and beat nobody; auto is held against the best on the photographs that judged"
        " both. Pictures are compared at one size; from smaller working copies they are a little smoother."
        f" {state['found_made']} of {state['outputs']} outputs were there before."
    )
    return tag("p", escape(said)) + tag("p", escape(machine), class_="dim")


def _db(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
