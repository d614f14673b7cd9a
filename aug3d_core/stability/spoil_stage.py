"""The stage that damages: a copy of what a stage made, spoiled by a dose.

Its record takes the place of the whole one, so that everything after it reads the damaged files and nothing else differs.
"""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from aug3d_core.stability.config import SpoilConfig
from aug3d_core.stage import Inputs, Outcome, Progress

Damage = Callable[[Path, float, np.random.Generator], None]  # folder to damage in place, dose, source of chance


def run(inputs: Inputs, config: SpoilConfig, out: Path, progress: Progress) -> Outcome:
    """Copy the files and damage the copy."""
    shutil.copytree(inputs["whole"], out, dirs_exist_ok=True)
    module, _, name = config.damage.partition(":")
    damage: Damage = getattr(importlib.import_module(module), name)
    damage(out, config.dose, np.random.default_rng(config.seed))
    progress(1, 1, name)
    return Outcome(metrics={"dose": config.dose})
