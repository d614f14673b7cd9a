"""How long each run of a study is trained: the same in every arm, and less than a single good model would be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from aug3d_core.study.scene import FinishedScene

_SHARE, _QUICK_SHARE = 1 / 4, 1 / 60  # of the preset's steps
# No arm ends before another, and nothing is drawn: a study has many models, and looks at none of them.
_ALIKE = ("training.least_gain_db=0", "evaluation.panels=0", "evaluation.flythrough_frames=0")


def study_effort(scene: FinishedScene, quick: bool, overrides: Iterable[str]) -> FinishedScene:
    """Return the scene with the steps of a study, and what the user sets on top."""
    training = scene.settings.training
    share = _QUICK_SHARE if quick else _SHARE
    shortened = [
        f"training.{name}={max(1, round(share * getattr(training, name)))}" for name in ("steps", "warmup_steps")
    ]
    return replace(scene, settings=scene.config((*shortened, *_ALIKE, *overrides)))


def repeats(seeds: int, quick: bool) -> int:
    """Return how often each arm is made: twice at most for a look, since an interval needs two."""
    return min(seeds, 2) if quick else seeds
