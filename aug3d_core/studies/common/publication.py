"""What a study publishes: data for programs, a chart and a page for people, and runs of MLflow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.studies.common.cell import Result


@dataclass(frozen=True)
class LoggedRun:
    """A run of MLflow. Parameters are logged as text; only numbers are logged of `metrics`."""

    name: str
    tags: Mapping[str, str] = field(default_factory=dict)
    params: Mapping[str, object] = field(default_factory=dict)
    metrics: Mapping[str, object] = field(default_factory=dict)
    failed: bool = False


@dataclass(frozen=True)
class Publication:
    """Everything that a study writes and logs.

    place: the folder in `studies` and the experiment of MLflow: the scene's name, or the study's own.
    label: begins the folder's name. title: the page's title. question: its heading.
    about: the study, its scene and its size: a newer study replaces an older one in the story.
    data: `study.json`. table: `scores.parquet`. draw: writes the chart. facts: the line below the heading.
    chapters: HTML for the story and the page, by chapter, given the chart. before, after: HTML of the page around them.
    method, cost: how the study was done, and on which machine. script: HTML that the page needs in its head.
    tags, params, metrics: of the study's run in MLflow. cells: of the runs nested in it.
    """

    place: str
    label: str
    title: str
    question: str
    about: str
    data: Mapping[str, Any]
    table: pd.DataFrame
    draw: Callable[[Path], None]
    facts: Mapping[str, str]
    chapters: Callable[[Path], dict[str, str]]
    method: str
    cost: str
    tags: Mapping[str, str]
    params: Mapping[str, object]
    metrics: Mapping[str, object]
    cells: Sequence[LoggedRun]
    before: str = ""
    after: str = ""
    script: str = ""


def logged(
    result: Result[Any],
    params: Mapping[str, object],
    metrics: Mapping[str, object] | None = None,
    tags: Mapping[str, str] | None = None,
    failed: bool | None = None,
) -> LoggedRun:
    """Return the run of a cell: what a study adds, and everything that the stages measured."""
    measured = {
        f"{step}.{name}": value
        for step, record in result.records.items()
        for name, value in {**record.metrics, "seconds": record.seconds, "cpu_seconds": record.cpu_seconds}.items()
    }
    digests = {f"digest.{step}": record.digest for step, record in result.records.items()}
    return LoggedRun(
        result.cell.name,
        {**({"failure": result.failure} if tags is None else tags), **digests},
        {**params, "seed": result.seed},
        {**(metrics or {}), **measured},
        bool(result.failure) if failed is None else failed,
    )
