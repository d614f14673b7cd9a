"""A measured figure, and whether it reaches its goal."""

from __future__ import annotations

import multiprocessing
import resource
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

from aug3d_core.studies.common.trial import Trial

T = TypeVar("T")


@dataclass(frozen=True)
class Figure:
    """value is None where it could not be measured; goal and holds are None where there is nothing to reach."""

    value: float | None
    unit: str
    goal: float | None = None
    holds: bool | None = None
    failure: str = ""


def at_least(goal: float, value: float | None, unit: str) -> Figure:
    """Return a figure that should not fall below its goal."""
    return Figure(value, unit, goal, value is not None and value >= goal)


def at_most(goal: float, value: float | None, unit: str) -> Figure:
    """Return a figure that should not rise above its goal."""
    return Figure(value, unit, goal, value is not None and value <= goal)


def told(trial: Trial, stage: str, name: str) -> float | None:
    """Return a stage's figure as a number, None where the trial did not get there."""
    value = trial.metric(stage, name)
    return None if value is None else float(value)


def in_own_process(work: Callable[[], T]) -> T:
    """Return what a function returns that runs in a new process: its memory and its engines are its own."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work).result()


def peak_mib() -> float:
    """Return the most memory that this process had, or a child of it if that had more [MiB]."""
    return max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
