"""What training decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.heads.pixelnerf.config import TrainingConfig
from aug3d_core.run.stage import Decision


def decisions(metrics: Mapping[str, Any], config: TrainingConfig) -> Iterator[Decision]:
    """Yield how long the model was trained, and what its encoder started from."""
    all_of_them = metrics["stopped_by"] == "steps"
    yield Decision(
        field="training.steps_made",
        value=metrics["steps"],
        measured=f"{config.steps} asked for",
        rule="all of them were worth it" if all_of_them else "no more gain on fixed rays of training groups",
        saves="" if all_of_them else f"{config.steps - metrics['steps']} steps",
    )
    yield Decision(
        field="training.encoder_from",
        value=metrics["encoder_from"],
        measured=f"{config.encoder_weights} asked for",
        rule="what is at hand",
    )
