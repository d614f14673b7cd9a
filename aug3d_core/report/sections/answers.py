"""Training and test: learning curves, and the model compared with the cheap answers per group and per photograph."""

from __future__ import annotations

import json
from html import escape

import numpy as np
import pandas as pd

from aug3d_core.heads.config import title_of
from aug3d_core.judging.files import CONVENTIONS, TEST_VIEWS, prediction_of, truth_of
from aug3d_core.judging.names import called
from aug3d_core.judging.summary import CHEAP
from aug3d_core.metrics.pooled import test_views
from aug3d_core.photos.files import image_name
from aug3d_core.report.html import number, slider, table, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.svg import curve

_ENDS = {"steps": "all requested steps done", "plateau": "stopped early at a plateau"}
_CURVES = {"train_psnr": "training PSNR [dB]", "train_loss": "training loss"}


def training(run: ReportedRun) -> str:
    """Return the learning curves of every fold, and how training ended."""
    cards, said = [], []
    for fold in range(run.folds):
        record, name = run.in_fold(fold).record("training"), f", fold {fold}" if run.folds > 1 else ""
        if record is None:
            continue
        m = record.metrics
        ended = _ENDS.get(str(m.get("stopped_by")), "") if m.get("steps") else "the first weights as they are"
        said.append(
            f"{number(m.get('steps'))} steps{name}, {ended};"
            f" {number(m.get('restarts'))} restarts; {number(m.get('parameters'))} parameters;"
            f" {number(m.get('groups_per_second'))} groups per second."
        )
        for series, points in record.series.items():
            title = f"{_CURVES.get(series, series)}{name}"
            cards.append(tag("div", tag("h3", escape(title)) + curve(points, title), class_="card"))
    return "".join(tag("p", line) for line in said) + (tag("div", "".join(cards), class_="curves") if cards else "")


def test(run: ReportedRun) -> str:
    """Return the test of all folds: groups as in the paper's first table, held-out photographs, panels."""
    tests, views = [run.in_fold(fold) for fold in range(run.folds)], tested(run)
    if not len(views):
        return ""
    stated = tests[0].file("evaluation", CONVENTIONS)
    rules = json.loads(stated.read_text()) if stated else None
    panels = "".join(each.pictures("evaluation") for each in tests)
    head = title_of(run.metrics.get("nvs", {}).get("head"))
    return (
        _groups(views, rules, head)
        + _compared(run, views)
        + _photos(run, views, head)
        + tag("h3", "Panels: inputs, photograph, prediction, depth, error, cheap answers")
        + tag("div", panels, class_="card pictures panels")
    )


def tested(run: ReportedRun) -> pd.DataFrame:
    """Return a row per held-out photograph of every fold; empty before a test."""
    files = [run.in_fold(fold).file("evaluation", TEST_VIEWS) for fold in range(run.folds)]
    folders = [file.parent for file in files if file]
    return test_views(folders) if folders else pd.DataFrame()


def pair(run: ReportedRun, photo_id: int, fold: int, psnr_db: float) -> str:
    """Return a slider between prediction and photograph of a held-out photograph; empty if it was not drawn."""
    each, photo = run.in_fold(fold), image_name(photo_id)
    predicted, true = (each.file("evaluation", name) for name in (prediction_of(photo), truth_of(photo)))
    if not (predicted and true):
        return ""
    return slider(predicted, true, f"{each.called(photo_id)}: {psnr_db:.1f} dB", "predicted", "photograph")


def _compared(run: ReportedRun, views: pd.DataFrame) -> str:
    """Return a slider between prediction and photograph for each held-out photograph that was drawn, best first."""
    best_first = views.sort_values("psnr", ascending=False)
    drawn = "".join(
        pair(run, int(photo), int(fold), float(psnr))
        for photo, fold, psnr in zip(best_first["photo_id"], best_first["fold"], best_first["psnr"], strict=True)
    )
    if not drawn:
        return ""
    return tag("h3", "Prediction against photograph: move the line") + tag("div", drawn, class_="card pictures")


def _answers(views: pd.DataFrame) -> list[str]:
    return ["psnr", *(f"{name}_psnr" for name in CHEAP if f"{name}_psnr" in views)]


def _called(answer: str, head: str) -> str:
    return head if answer == "psnr" else called(answer.removesuffix("_psnr"))


def _groups(views: pd.DataFrame, rules: dict[str, str] | None, head: str) -> str:
    """Return a row per answer with its best, lowest and average test group, as in the paper's first table."""
    rows = []
    for name in _answers(views):
        by_group = np.asarray(views.groupby(["fold", "group"])[name].mean())
        others = [name.removesuffix("psnr") + score for score in ("ssim", "flip")]
        rows.append(
            (
                _called(name, head),
                *(f"{figure:.2f}" for figure in (by_group.max(), by_group.min(), by_group.mean())),
                *(f"{views[score].mean():.3f}" if score in views else "-" for score in others),
            )
        )
    count = views.groupby(["fold", "group"]).ngroups
    said = f"PSNR [dB] over {count} test groups; SSIM (1: the same) and FLIP (0: the same) over all test views."
    if rules:
        said += f" Answers are {rules['answers']}. PSNR {rules['psnr']}. Photographs: {rules['photographs']}."
    heads = ("answer", "best group", "lowest group", "average", "SSIM", "FLIP")
    return tag("h3", "Test groups") + tag("p", escape(said), class_="dim") + table(heads, rows, range(1, len(heads)))


def _photos(run: ReportedRun, views: pd.DataFrame, head: str) -> str:
    """Return a row per held-out photograph with the PSNR of every answer, the best in bold."""
    answers, rows = _answers(views), []
    for row in views.sort_values("psnr", ascending=False).to_dict("records"):
        best = max(row[name] for name in answers)
        scores = [tag("span", f"{row[n]:.2f}", class_="best") if row[n] == best else f"{row[n]:.2f}" for n in answers]
        rows.append((escape(run.called(int(row["photo_id"]))), str(row["fold"]), f"{row['ssim']:.3f}", *scores))
    heads = ("photograph", "fold", "SSIM", *(_called(name, head) for name in answers))
    intro = tag("p", "PSNR [dB] of each held-out photograph; the best answer in bold.", class_="dim")
    return tag("h3", "Held-out photographs") + intro + table(heads, rows, numeric=range(1, len(heads)))
