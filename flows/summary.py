"""The end of a run as a person reads it: stages, the model beside the cheap answers, where things are, what is next."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.factory.config import AUTO
from aug3d_core.factory.plan import stage_of
from aug3d_core.heads.config import title_of
from aug3d_core.judging.names import called, interval_words
from aug3d_core.store import layout
from aug3d_core.store.scenes import damaged_versions
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME
from flows.settings import HOME_VARIABLE
from flows.words import figure, traffic_words, widened


def tell_of_damage(store: Store, scene: str) -> None:
    """Say which versions of a scene count as absent, on stderr: their `metrics.json` is not what was written."""
    for note in damaged_versions(store, scene):
        Console(stderr=True).print(f"[yellow]note[/] {escape(note)}", highlight=False, soft_wrap=True)


def print_summary(console: Console, metrics: dict[str, Any]) -> None:
    """Print everything a run tells."""
    console = widened(console)
    console.print(_stage_table(metrics))
    if decided := [row for row in metrics.get("needs", ()) if row["by"] == AUTO and not row["fold"]]:
        console.print(_needs_table(decided))
    if "nvs" in metrics:
        console.print(_view_synthesis_table(metrics["nvs"]))
        folds = len(metrics["nvs"].get("fold_psnr_means", []))  # runs of earlier versions had one, and did not say so
        if folds > 1:
            console.print(f"{folds} folds: every figure is over all of them")
    for stage, figures in metrics["stages"].items():
        for note in figures["notes"]:
            console.print(f"[yellow]note[/] {stage}: {escape(note)}", highlight=False)
    if why := metrics.get("mlflow", {}).get("waiting"):
        console.print(f"[yellow]note[/] {escape(why)}", highlight=False, soft_wrap=True)
    _print_places(console, metrics)


def _stage_table(metrics: dict[str, Any]) -> Table:
    table = Table(
        "stage", title=f"{metrics['scene']} ({metrics['preset']}): {metrics['state']} in {metrics['seconds']:.0f} s"
    )
    for heading in ("seconds", "peak MiB", "MiB on disk"):
        table.add_column(heading, justify="right")
    for heading in ("accuracy", "cached", "state"):
        table.add_column(heading)
    for name, figures in metrics["stages"].items():
        accuracy = stage_of(name).accuracy
        table.add_row(
            name,
            f"{figures['seconds']:.1f}",
            f"{figures['peak_mib']:.0f}",
            f"{figures['size_mib']:.1f}",
            f"{accuracy} = {figure(figures['metrics'].get(accuracy))}",
            "yes" if figures["cached"] else "no",
            figures["state"],
        )
    return table


def _needs_table(decided: list[dict[str, Any]]) -> Table:
    table = Table("setting", title="no more than the scene needs; what it saves and may cost is in the report")
    table.add_column("value", justify="right")
    for heading in ("measured", "rule"):
        table.add_column(heading)
    for row in decided:
        table.add_row(row["field"], figure(row["value"]), escape(row["measured"]), escape(row["rule"]))
    return table


def _view_synthesis_table(nvs: dict[str, Any]) -> Table:
    table = Table("answer", title=f"held-out photographs: {nvs['test_views']} views")
    table.add_column("PSNR dB", justify="right")
    table.add_column("SSIM", justify="right")
    table.add_row(
        title_of(nvs.get("head")),
        f"{nvs['test_psnr_mean']:.2f}{interval_words(nvs['test_psnr_ci'])}",
        f"{nvs['test_ssim_mean']:.3f}",
    )
    for name, psnr in nvs["cheap"].items():
        table.add_row(called(name), "-" if psnr is None else f"{psnr:.2f}", "")
    return table


def _print_places(console: Console, metrics: dict[str, Any]) -> None:
    paths = metrics["paths"]
    places = {
        "report": paths["report"],
        "metrics": paths["metrics"],
        "MLflow": _mlflow_pages(paths),
    }
    if shared := metrics.get("shared_store"):
        places["store"] = traffic_words(shared)
    if "rendering" in paths["objects"]:
        places["renders"] = paths["objects"]["rendering"]
    if "dataset" in paths["objects"]:
        places["data set"] = paths["objects"]["dataset"]
    for name, place in places.items():
        console.print(f"{name:>9}  {place}", highlight=False, soft_wrap=True, markup=False)


def _mlflow_pages(paths: Mapping[str, Any]) -> str:
    """Return where the runs are to be seen: what holds them, or the command that serves the home's own database.

    MLflow's own command would serve it to every page in the owner's browser.
    """
    _, _, _, home, *_ = Path(paths["metrics"]).parents
    own = paths["mlflow"] == f"sqlite:///{home / layout.MLFLOW_DATABASE}"
    return shlex.join([_program(), "up", "--home", str(home)]) if own else paths["mlflow"]


def command(home: Path, *words: str | Path) -> str:
    """Return a command of aug3d for the user's shell; it names the home if the command would not find it by itself."""
    found = Path(os.environ.get(HOME_VARIABLE) or DEFAULT_HOME)
    where = [] if home.resolve() == found.resolve() else ["--home", str(home)]
    return shlex.join([_program(), *map(str, words), *where])


def _program() -> str:
    """Return how to call aug3d of this environment from the user's shell."""
    return "aug3d" if shutil.which("aug3d") else str(Path(sys.executable).parent / "aug3d")
