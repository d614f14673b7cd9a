"""The arms of a table, and the orderings that it tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from aug3d_core.factory.config import SceneConfig
from aug3d_core.run.nested import flat


@dataclass(frozen=True)
class PaperArm:
    """One way to make a model.

    labels: cells of its row, by column.
    settings: differences from the scene's own settings, `stage.field=value`.
    rendered_share: virtual views over training photographs; 0: only photographs.
    part: the part of the study that it is charted in.
    against: name of the arm that its row is compared with.
    """

    name: str
    labels: Mapping[str, str]
    settings: tuple[str, ...]
    rendered_share: float
    part: str
    against: str


@dataclass(frozen=True)
class Ordering:
    """A claim that holds if the first arm of every pair is above the second.

    paper: whether the paper makes the claim; otherwise it is our own question.
    """

    claim: str
    pairs: tuple[tuple[str, str], ...]
    paper: bool = True


@dataclass(frozen=True)
class PaperTable:
    """A grid of arms.

    then: returns further arms after the first are judged. It is given the mean PSNR [dB] and the mean K of each arm that has
    a score in every fold, by name.
    """

    name: str
    question: str
    arms: tuple[PaperArm, ...]
    then: Callable[[Mapping[str, tuple[float, float]]], Sequence[PaperArm]]
    orderings: tuple[Ordering, ...]


def nothing_more(_judged: Mapping[str, tuple[float, float]]) -> Sequence[PaperArm]:
    """Add no arms."""
    return ()


def fitting(table: PaperTable, config: SceneConfig) -> PaperTable:
    """Return a table without the arms that set what a scene's head does not have."""
    there = flat(config.model_dump())
    arms = tuple(arm for arm in table.arms if all(one.partition("=")[0] in there for one in arm.settings))
    left = {arm.name for arm in arms}
    asked = tuple(o for o in table.orderings if all(name in left for pair in o.pairs for name in pair))
    dropped = len(arms) < len(table.arms)  # an ordering may also be of arms that come later
    return replace(table, arms=arms, orderings=asked if dropped else table.orderings)
