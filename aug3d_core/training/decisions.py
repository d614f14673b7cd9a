"""What training decides by itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aug3d_core.run.stage import Decision
from aug3d_core.training.config import TrainingConfig

_ALL, _NONE = "all of them were worth it", "the first weights are used as they are"


def steps_made(metrics: Mapping[str, Any], config: TrainingConfig) -> Decision:
    """Return how long the model was trained, and why no longer."""
    all_of_them = metrics["stopped_by"] == "steps"
    return Decision(
        field="training.steps_made",
        value=metrics["steps"],
        measured=f"{config.steps} asked for",
        rule=(_ALL if metrics["steps"] else _NONE) if all_of_them else "no more gain on fixed groups",
        saves="" if all_of_them else f"{config.steps - metrics['steps']} steps",
    )
