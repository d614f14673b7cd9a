"""The scene report: everything a run tells, as one HTML page that needs no network."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.charts.html import duration, number, picture, spaced, table, tag
from aug3d_core.charts.report_style import STYLE
from aug3d_core.charts.svg import Bar, bars, curve
from aug3d_core.stage import Stage
from aug3d_core.store import layout
from aug3d_core.store.record import Record

Made = Sequence[tuple[Stage, Record, Path]]  # the stage, its record, the folder with its files


def write_report(records: Made, metrics: Mapping[str, Any], out: Path) -> None:
    """Write the report of a run, whole or failed; `metrics` is what its metrics.json holds."""
    sections = [
        _header(metrics),
        _stages(records, metrics),
        _curves(records),
        _test_views(records),
        _unplaced(records),
        *(_stage(stage, record, folder) for stage, record, folder in records if record.pictures),
        _origin(records, metrics),
    ]
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1">'
        + tag("title", f"{escape(metrics['scene'])} - aug3d")
        + tag("style", STYLE)
    )
    page = f'<!doctype html><html lang="en"><head>{head}</head><body>{tag("main", "".join(sections))}</body></html>\n'
    out.write_text(page, encoding="utf-8")


def _header(metrics: Mapping[str, Any]) -> str:
    """Return the name, the state, what the run cost, and what the model reaches."""
    badge = tag("span", escape(metrics["state"]), class_=f"badge {metrics['state']}")
    facts = {
        "preset": escape(metrics["preset"]),
        "took": duration(metrics["seconds"]),
        "peak memory": f"{metrics['peak_mib']:,.0f} MiB",
        "code": escape(str(metrics["git"])[:12]),
    }
    line = "".join(tag("span", f"{name} {tag('b', value)}") for name, value in facts.items())
    top = tag("div", tag("h1", escape(metrics["scene"])) + badge, class_="top") + tag("div", line, class_="facts")
    if "failure" in metrics:
        text = tag("h3", "The run stopped") + tag("pre", escape(metrics["failure"]["problem"]))
        return top + tag("div", text + tag("p", escape(metrics["failure"]["remedy"])), class_="card failure")
    if "nvs" not in metrics:
        return top
    return top + _view_synthesis(metrics["nvs"])


def _view_synthesis(nvs: Mapping[str, Any]) -> str:
    """Return the model's PSNR as a number, a sentence, and bars beside the cheap answers."""
    low, high = nvs["test_psnr_ci"]
    model = nvs["test_psnr_mean"]
    cheap = sorted(((v, k) for k, v in nvs["cheap"].items() if v is not None), reverse=True)
    rows = [Bar("PixelNeRF", model, f"{model:.2f} dB", (low, high), main=True)]
    rows += [Bar(name.replace("_", " "), value, f"{value:.2f} dB") for value, name in cheap]
    rows += [Bar(name.replace("_", " "), None, "no answer") for name, value in nvs["cheap"].items() if value is None]
    words = [
        tag("div", f"{model:.2f} <small>dB PSNR</small>", class_="big"),
        tag("p", _verdict(model, low, high, cheap)),
        tag(
            "p",
            f"{nvs['test_views']} held-out photos, 95 % interval {low:.2f} to {high:.2f} dB,"
            f" SSIM {nvs['test_ssim_mean']:.3f}. Groups: best {nvs['groups']['best']:.2f}, lowest"
            f" {nvs['groups']['low']:.2f}, average {nvs['groups']['average']:.2f} dB.",
            class_="dim",
        ),
    ]
    chart = tag("div", bars(rows, "PSNR of the model and of the cheap answers"), class_="wide")
    return tag("div", tag("div", "".join(words)) + chart, class_="card hero")


def _verdict(model: float, low: float, high: float, cheap: Sequence[tuple[float, str]]) -> str:
    if not cheap:
        return "No cheap answer to compare with."
    best, name = cheap[0]
    side = "above" if model >= best else "below"
    doubt = "; the interval of the model holds both" if low <= best <= high else ""
    return f"{tag('b', f'{abs(model - best):.2f} dB {side}')} the best cheap answer, {spaced(name)}{doubt}."


def _stages(records: Made, metrics: Mapping[str, Any]) -> str:
    """Return the table of stages and the notes under it."""
    figures = metrics["stages"]
    longest = max((f["seconds"] for f in figures.values()), default=0.0) or 1.0
    rows, notes = [], []
    for stage, record, _ in records:
        cost = figures[stage.name]
        share = f'<span class="share" style="width:{90 * cost["seconds"] / longest:.0f}px"></span>'
        accuracy = f"{spaced(stage.accuracy)} {tag('b', number(record.metrics.get(stage.accuracy)))}"
        state = tag("span", escape(record.state), class_=record.state)
        cached = "cached" if cost["cached"] else "computed"
        rows.append((
            escape(stage.name), duration(cost["seconds"]), share, accuracy, state, cached, f"{cost['peak_mib']:,.0f}",
            f"{record.size_bytes / 2**20:,.1f}",
        ))  # fmt: skip
        notes += [tag("div", f"{tag('b', escape(stage.name))} {escape(note)}", class_="note") for note in record.notes]
    heads = ("stage", "time", "", "how well", "state", "this run", "peak MiB", "MiB on disk")
    return tag("h2", "Stages") + table(heads, rows, numeric=(1, 6, 7)) + "".join(notes)


def _curves(records: Made) -> str:
    drawn = [
        tag("div", tag("h3", f"{escape(stage.name)}: {spaced(name)}") + curve(points, name), class_="card")
        for stage, record, _ in records
        for name, points in record.series.items()
        if points
    ]
    return tag("h2", "Curves") + tag("div", "".join(drawn), class_="curves") if drawn else ""


def _test_views(records: Made) -> str:
    """Return a row per held-out photo: every answer's PSNR, the best in bold."""
    folder = _folder(records, "evaluation")
    if folder is None or not (folder / layout.TEST_VIEWS).is_file():
        return ""
    views = pd.read_parquet(folder / layout.TEST_VIEWS).sort_values("psnr", ascending=False)
    answers = ["psnr", *(c for c in views.columns if c.endswith("_psnr") and c != "coarse_psnr")]
    rows = []
    for row in views.to_dict("records"):
        best = max(row[name] for name in answers)
        scores = [tag("span", f"{row[n]:.2f}", class_="best") if row[n] == best else f"{row[n]:.2f}" for n in answers]
        rows.append((str(row["photo_id"]), str(row["group"]), f"{row['ssim']:.3f}", *scores))
    heads = ("photo", "group", "SSIM", "PixelNeRF", *(spaced(name.removesuffix("_psnr")) for name in answers[1:]))
    intro = tag("p", "PSNR in dB of each held-out photo; the best answer in bold.", class_="dim")
    return tag("h2", "Held-out photos") + intro + table(heads, rows, numeric=range(len(heads)))


def _unplaced(records: Made) -> str:
    """Return a row per photo that fell out of the reconstruction: which, and the likely reason."""
    folder = _folder(records, "sfm")
    if folder is None or not (folder / layout.UNPLACED).is_file():
        return ""
    photos = pd.read_parquet(folder / layout.UNPLACED)
    if photos.empty:
        return ""
    rows = [
        (escape(row["name"]), escape(row["reason"]), *(str(row.get(n, "-")) for n in ("features", "matched_pairs")))
        for row in photos.to_dict("records")
    ]
    intro = tag("p", "Photos that have no place in the model, and the likely reason.", class_="dim")
    return tag("h2", "Photos left out") + intro + table(("photo", "reason", "features", "pairs"), rows, numeric=(2, 3))


def _folder(records: Made, name: str) -> Path | None:
    return next((folder for stage, _, folder in records if stage.name == name), None)


def _stage(stage: Stage, record: Record, folder: Path) -> str:
    """Return a stage's figures and pictures."""
    figures = "".join(tag("span", f"{spaced(k)} {tag('b', number(v))}") for k, v in record.metrics.items())
    shown = "".join(
        picture(folder / path, caption) for caption, path in record.pictures.items() if (folder / path).is_file()
    )
    content = tag("div", figures, class_="figures") + tag("div", shown, class_="pictures")
    return tag("h2", escape(stage.name)) + tag("section", content, class_="card")


def _origin(records: Made, metrics: Mapping[str, Any]) -> str:
    """Return what it takes to get the same again: digests, engine versions, configurations."""
    rows = [
        (
            escape(stage.name),
            tag("code", escape(record.key[:16])),
            tag("code", escape(record.digest[:16])),
            escape(", ".join(f"{name} {version}" for name, version in record.versions.items())) or "-",
            number(record.config.get("seed")),
        )
        for stage, record, _ in records
    ]
    heads = ("stage", "key", "digest of the files", "engines", "seed")
    config = json.dumps({stage.name: record.config for stage, record, _ in records}, indent=1)
    settings = tag("details", tag("summary", "All settings") + tag("pre", escape(config)))
    shareable = {name: value for name, value in metrics.items() if name != "paths"}  # the page travels, folders do not
    figures = escape(json.dumps(shareable, indent=1))
    raw = tag("details", tag("summary", "All figures (metrics.json)") + tag("pre", figures))
    return tag("h2", "Where this comes from") + table(heads, rows) + settings + raw
