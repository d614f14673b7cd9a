"""What a study compares, and what it wants to know."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Arm:
    """One way to make a model.

    key: its name in the study.
    labels: what its row says of it, by column.
    settings: how it differs from the scene's own settings, `stage.field=value`.
    rendered_share: virtual views over training photographs; 0: photographs alone.
    part: the part of the study that it is charted with.
    against: key of the arm that its row is compared with.
    """

    key: str
    labels: Mapping[str, str]
    settings: tuple[str, ...]
    rendered_share: float
    part: str
    against: str


@dataclass(frozen=True)
class Ordering:
    """A statement that holds if the first arm of every pair is above the second.

    claim: the statement. paper: whether it is one of the paper's, else it is our own question.
    """

    claim: str
    pairs: tuple[tuple[str, str], ...]
    paper: bool = True


@dataclass(frozen=True)
class Study:
    """A grid of arms.

    then: further arms once the first are judged, from the mean PSNR and the mean K of each that could be (key -> (dB, K)).
    """

    name: str
    question: str
    arms: tuple[Arm, ...]
    then: Callable[[Mapping[str, tuple[float, float]]], Sequence[Arm]]
    orderings: tuple[Ordering, ...]


def nothing_more(_judged: Mapping[str, tuple[float, float]]) -> Sequence[Arm]:
    """Add no arms."""
    return ()
