"""The top of the report: name, state, cost, why a run stopped, and the model compared with the cheap answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from aug3d_core.heads.config import title_of
from aug3d_core.judging.names import called
from aug3d_core.report.html import duration, spaced, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.svg import Bar, bars

_MEANS = {
    "ok": "every stage succeeded",
    "degraded": "usable, but some stages report problems",
    "refused": "the run stopped; the report shows the stages before",
}

_SHOWN_NOTES = 6


def headline(run: ReportedRun) -> str:
    """Return the name, the state and the cost of the run."""
    metrics = run.metrics
    state = metrics["state"]
    badge = tag("span", escape(state), class_=f"badge {state}") + tag("span", _MEANS.get(state, ""), class_="dim")
    cpu = [figures["cpu_seconds"] for figures in metrics["stages"].values() if figures.get("cpu_seconds") is not None]
    facts = {
        "preset": escape(metrics["preset"]),
        "took": duration(metrics["seconds"]),
        "processors": duration(sum(cpu)) if cpu else "-",
        "peak memory": f"{metrics['peak_mib']:,.0f} MiB",
        "code": escape(str(metrics["git"])[:12]),
    }
    line = "".join(tag("span", f"{name} {tag('b', value)}") for name, value in facts.items())
    return tag("div", tag("h1", escape(metrics["scene"])) + badge, class_="top") + tag("div", line, class_="facts")


def failure(run: ReportedRun) -> str:
    """Return why the run stopped and what to do; empty if it did not stop."""
    if "failure" not in run.metrics:
        return ""
    told = run.metrics["failure"]
    text = tag("h3", "The run stopped") + tag("pre", escape(told["problem"])) + tag("p", escape(told["remedy"]))
    return tag("div", text, class_="card failure")


def notes(run: ReportedRun) -> str:
    """Return the notes of the stages: first those that degrade the run; the rest is folded if it is long."""
    worse, rest = [], []
    for step, record, _ in run.made:
        for note in record.notes:
            drawn = tag("div", f"{tag('b', spaced(step.name))} {escape(note)}", class_=f"note {record.state}")
            (worse if record.state == "degraded" else rest).append(drawn)
    if len(worse) + len(rest) <= _SHOWN_NOTES or not rest:
        return "".join(worse + rest)
    return "".join(worse) + tag("details", tag("summary", f"{len(rest)} more notes") + "".join(rest))


def beside_cheap(run: ReportedRun) -> str:
    """Return the model's PSNR as a number, a sentence, and bars with the cheap answers."""
    nvs = run.metrics.get("nvs")
    return _beside_cheap(nvs) if nvs else ""


def _tested(views: int, ends: Sequence[float] | None) -> str:
    """Return the number of test photographs and the interval; one photograph has none."""
    photographs = f"{views} held-out photograph{'s' if views > 1 else ''}"
    return f"{photographs}, 95 % interval {ends[0]:.2f} to {ends[1]:.2f} dB" if ends else f"{photographs}: no interval"


def _beside_cheap(nvs: Mapping[str, Any]) -> str:
    ends = nvs["test_psnr_ci"]
    model = nvs["test_psnr_mean"]
    cheap = sorted(((v, k) for k, v in nvs["cheap"].items() if v is not None), reverse=True)
    rows = [Bar(title_of(nvs.get("head")), model, f"{model:.2f} dB", ends, main=True)]
    rows += [Bar(called(name), value, f"{value:.2f} dB") for value, name in cheap]
    rows += [Bar(called(name), None, "no answer") for name, value in nvs["cheap"].items() if value is None]
    folds = nvs.get("fold_psnr_means", [])
    each_db = f" Single photographs: {nvs['test_psnr_worst']:.2f} to {nvs['test_psnr_best']:.2f} dB."
    words = [
        tag("div", f"{model:.2f} <small>dB PSNR</small>", class_="big"),
        tag("p", _verdict(model, cheap, nvs["over_ci"])),
        tag(
            "p",
            f"{_tested(nvs['test_views'], ends)},"
            f" SSIM {nvs['test_ssim_mean']:.3f}.{each_db if nvs['test_views'] > 1 else ''}",
            class_="dim",
        ),
    ]
    if len(folds) > 1:
        each = ", ".join(f"{psnr:.2f}" for psnr in folds)
        words.append(tag("p", f"{len(folds)} folds; every figure covers all of them. By fold: {each} dB."))
    chart = tag("div", bars(rows, "PSNR of the model and of the cheap answers"), class_="wide")
    return tag("div", tag("div", "".join(words)) + chart, class_="card hero")


def _verdict(model: float, cheap: Sequence[tuple[float, str]], over_ci: Mapping[str, Sequence[float] | None]) -> str:
    if not cheap:
        return "There is no cheap answer to compare with."
    best, name = cheap[0]
    side = "above" if model >= best else "below"
    if ends := over_ci[name]:
        doubt = ": not decided" if ends[0] <= 0 <= ends[1] else ""
        paired = f"95 % interval of the difference {ends[0]:+.2f} to {ends[1]:+.2f} dB, paired over photographs{doubt}"
    else:
        paired = "one photograph: not decided"
    return f"{tag('b', f'{abs(model - best):.2f} dB {side}')} the best cheap answer, {spaced(name)} ({paired})."
