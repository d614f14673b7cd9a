"""The stage that damages: a copy of a stage's output, damaged by a dose.

Its record replaces the whole one, so that later stages read the damaged files.
"""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.studies.stability.config import DamageConfig

Damaging = Callable[[Path, float, np.random.Generator], None]  # folder to damage in place, dose, random generator


def run(inputs: Inputs, config: DamageConfig, out: Path, progress: Progress) -> Outcome:
    """Copy the files and damage the copy."""
    shutil.copytree(inputs["whole"], out, dirs_exist_ok=True)
    module, _, name = config.damage.partition(":")
    damage: Damaging = getattr(importlib.import_module(module), name)
    damage(out, config.dose, np.random.default_rng(config.seed))
    progress(1, 1, name)
    return Outcome(metrics={"dose": config.dose})
