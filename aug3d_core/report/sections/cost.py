"""The cost of every stage: time, processor time, memory, disk space."""

from __future__ import annotations

from html import escape

from aug3d_core.report.html import duration, number, percent, spaced, table, tag
from aug3d_core.report.reported_run import ReportedRun


def cost(run: ReportedRun) -> str:
    """Return the chart of time and memory, and the table of stages."""
    stages = run.metrics["stages"]
    if not stages:
        return ""
    seconds = sum(figures["seconds"] for figures in stages.values())
    cpu = sum(figures.get("cpu_seconds") or 0.0 for figures in stages.values())
    computed = sum(not figures["cached"] for figures in stages.values())
    said = (
        f"All stages: {tag('b', duration(seconds))}, processor time {tag('b', duration(cpu))}."
        f" This run took {tag('b', duration(run.metrics['seconds']))} and computed {computed} of {len(stages)} steps."
        f" {sum(f.get('size_mib') or 0.0 for f in stages.values()):,.0f} MiB on disk."
    )
    return tag("p", said) + _chart(run) + _table(run)


def _chart(run: ReportedRun) -> str:
    """Return two bars per stage: its share of the time, and its memory relative to the largest."""
    stages = run.metrics["stages"]
    seconds = [figures["seconds"] for figures in stages.values()]
    longest, largest = max(seconds) or 1.0, max(f["peak_mib"] for f in stages.values()) or 1.0
    rows = [
        tag("span", spaced(name), class_="name")
        + _bar(
            "time",
            figures["seconds"] / longest,
            f"{duration(figures['seconds'])} · {percent(figures['seconds'] / (sum(seconds) or 1))}",
        )
        + _bar("memory", figures["peak_mib"] / largest, f"{figures['peak_mib']:,.0f} MiB")
        for name, figures in stages.items()
    ]
    heads = (
        tag("span", "") + tag("span", "time, share of total", class_="head") + tag("span", "peak memory", class_="head")
    )
    return tag("div", heads + "".join(rows), class_="card costs")


def _bar(kind: str, share: float, said: str) -> str:
    """Return a bar with its figure beside it; the longest bar leaves space for the figure."""
    bar = f'<i class="{kind}" style="width:{62 * share:.1f}%"></i>'
    return tag("span", bar + tag("small", said), class_="cost")


def _table(run: ReportedRun) -> str:
    """Return the table of stages."""
    rows = []
    for step, record, _ in run.made:
        figures, accuracy = run.metrics["stages"][step.name], step.stage.accuracy
        cpu = figures.get("cpu_seconds")
        rows.append((
            spaced(step.name), duration(figures["seconds"]), "-" if cpu is None else duration(cpu),
            f"{figures['peak_mib']:,.0f}", f"{record.size_bytes / 2**20:,.1f}",
            f"{spaced(accuracy)} {tag('b', number(record.metrics.get(accuracy)))}",
            tag("span", escape(record.state), class_=record.state), "cached" if figures["cached"] else "computed",
            escape("; ".join(figures["why"]) or "unchanged") if "why" in figures else "-",
        ))  # fmt: skip
    heads = (
        "stage",
        "time",
        "processor time",
        "peak MiB",
        "MiB on disk",
        "accuracy",
        "state",
        "this run",
        "why computed again",
    )
    return tag("div", table(heads, rows, numeric=(1, 2, 3, 4)), class_="last-wraps")
