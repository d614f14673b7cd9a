"""The stage that makes a whole cell: a figure of an exactly known world, in a process of its own."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.studies.stability.config import ComputedConfig

# dose, method, seed, and a folder for pictures -> the judged figure, and the state that the factory would report
Compute = Callable[[float, str, int, Path], Outcome]


def run(inputs: Inputs, config: ComputedConfig, out: Path, progress: Progress) -> Outcome:
    """Compute the figure."""
    module, _, name = config.compute.partition(":")
    compute: Compute = getattr(importlib.import_module(module), name)
    outcome = compute(config.dose, config.method, config.seed, out)
    progress(1, 1, config.method)
    return outcome
