"""How long a head is trained: so many looks at each pixel that shows something of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from aug3d_core.factory.auto.decision import Known
from aug3d_core.factory.config import left_open
from aug3d_core.run.stage import Decision
from aug3d_core.training.config import TrainingConfig

_SHORT = 1000  # steps: what ends a training early sees too little of a shorter one


@dataclass(frozen=True)
class Length:
    """What a head needs, measured for it.

    looks: at each pixel of the distinct training photographs, in whatever mixture with renders. least_steps: the learning rate
    has to rise and fall. pixels_per_group: what a step looks at of a group. costs: what fewer steps cost.
    """

    looks: float
    least_steps: int
    pixels_per_group: Callable[[Known], int]
    costs: str

    @property
    def rules(self) -> Mapping[str, Callable[[Known], Decision | None]]:
        """The rules of what depends on the number of steps, by setting."""
        return {
            "training.steps": self.steps,
            "training.warmup_steps": self.warmup_steps,
            "training.least_gain_db": self.least_gain,
        }

    def steps(self, known: Known) -> Decision | None:
        """Look at each pixel so often."""
        looked_at = photographed_pixels(known)
        if looked_at is None:
            return None
        (pixels, told), training = looked_at, known.config.training
        at_once = training.groups_per_step * self.pixels_per_group(known)
        value = max(math.ceil(self.looks * pixels / at_once), self.least_steps)
        fewer = value < training.steps
        return Decision(
            field="training.steps",
            value=value,
            measured=f"{told}; a step looks at {at_once:,}",
            rule=f"{self.looks:g} looks at each of their pixels, at least {self.least_steps} steps",
            saves=f"{1 - value / training.steps:.0%} of the preset's {training.steps} steps" if fewer else "",
            costs=self.costs if fewer else "",
        )

    def warmup_steps(self, known: Known) -> Decision | None:
        """Let the learning rate rise within the same share of the steps as the preset has it."""
        decided, training = self._decided(known), known.config.training
        if decided is None:
            return None
        return Decision(
            field="training.warmup_steps",
            value=math.ceil(training.warmup_steps * decided / training.steps),
            measured=f"{decided} steps",
            rule=f"the share of them that the preset's {training.warmup_steps} are of its {training.steps}",
        )

    def least_gain(self, known: Known) -> Decision | None:
        """Make all of few steps: what ends a long training early sees too little of a short one."""
        decided = self._decided(known)
        if decided is None:
            return None
        short = decided <= _SHORT
        return Decision(
            field="training.least_gain_db",
            value=0.0 if short else TrainingConfig().least_gain_db,
            measured=f"{decided} steps",
            rule=f"0 (all steps are made) up to {_SHORT:,} steps; the usual beyond",
            costs="steps that gain nothing; on the town one of 600 steps of PixelNeRF ended at 275, about 0.5 dB below those"
            " that went on"
            if short
            else "",
        )

    def _decided(self, known: Known) -> int | None:
        """Return the number of steps if it is decided here."""
        decided = self.steps(known) if "steps" in left_open(known.config, "training") else None
        return int(decided.value or 0) if decided else None


def photographed_pixels(known: Known) -> tuple[int, str] | None:
    """Count the pixels of photographs worth training on as they are packed, and tell of them; None before the split."""
    photos, packed = known.training_photos, known.config.dataset
    if photos is None:
        return None
    pixels = photos * packed.width_px * packed.height_px
    return pixels, f"{photos} photographs are worth training on: {pixels:,} pixels"
