"""A measured figure, and whether it reaches its goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.studies.common.trial import Trial


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


def names_of(folders: Sequence[Path]) -> list[str]:
    """Return a name for each folder: its own, behind that of the folder above where several have the same."""
    own = [folder.resolve() for folder in folders]
    names = [folder.name for folder in own]
    return [
        f"{folder.parent.name}_{name}" if names.count(name) > 1 else name
        for folder, name in zip(own, names, strict=True)
    ]
