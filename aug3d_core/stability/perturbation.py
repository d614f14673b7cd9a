"""What is done to the factory, and when a method counts as broken by it: written down before anything is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from aug3d_core.stability.world import SMALL_TOWN
from aug3d_core.stage import Metric

Overrides = tuple[str, ...]  # `stage.field=value`
AS_IT_IS: Mapping[str, Overrides] = {"as it is": ()}  # the methods of a perturbation that tries one way alone


@dataclass(frozen=True)
class Judge:
    """The figure that says how well a method did, and the mark past which it counts as broken.

    stage: whose figure it is; a computed cell has one stage, which needs no name. why: where the mark comes from.
    over: another figure of that stage, such as a cheap answer's, that is taken off: what is judged is how far above it is.
    """

    metric: str
    better: Literal["higher", "lower"]
    mark: float
    why: str
    stage: str = ""
    over: str = ""

    @property
    def name(self) -> str:
        """What is judged, as tables call it."""
        return f"{self.metric} over {self.over}" if self.over else self.metric

    def figure(self, metrics: Mapping[str, Metric]) -> float | None:
        """Return what is judged, from the figures of its stage; None if the stage has none."""
        told = [metrics.get(name) for name in (self.metric, self.over) if name]
        numbers = [float(value) for value in told if isinstance(value, int | float)]
        return numbers[0] - sum(numbers[1:]) if len(numbers) == len(told) else None

    def broken(self, accuracy: float | None) -> bool:
        """Say whether a method is broken; one without a figure, or with one that is no number, is."""
        if accuracy is None:
            return True
        return not (accuracy >= self.mark if self.better == "higher" else accuracy <= self.mark)


@dataclass(frozen=True)
class Spoil:
    """A damage to what a stage made: `damage` is "module:function" in `aug3d_core.stability.spoils`."""

    stage: str
    damage: str


def no_settings(_dose: float) -> Overrides:
    """Set nothing."""
    return ()


@dataclass(frozen=True)
class InFactory:
    """The dose acts on a run of the factory on the town: through the town's settings, or by damage to what a stage made.

    until: the last stage of the run. settings: what a dose sets; a method's own settings come after. seeded: settings that
    a seed sets; damage has it anyway. world: the town. picture: the stage whose first picture shows what went wrong.
    """

    until: str
    settings: Callable[[float], Overrides] = no_settings
    spoil: Spoil | None = None
    seeded: tuple[str, ...] = ()
    world: Overrides = SMALL_TOWN
    picture: str = "sfm"


@dataclass(frozen=True)
class Computed:
    """The cell is a function of dose, method and seed: "module:function" in `aug3d_core.stability`, see `compute_stage`.

    Its outcome holds the judged figure, the state that the factory reports of such a world, and a picture if there is one.
    """

    compute: str


@dataclass(frozen=True)
class Perturbation:
    """One way to make work hard for one part of the factory.

    name: unique, few words, lower case. part: the chapter of the page. what: a sentence for people. doses: four or more,
    from harmless to ruinous, in `dose_unit`. methods: what is tried, by name, each with its settings.
    compared: methods that the factory does not offer, shown to compare: nobody is told anything of them, so none is silent.
    quick: whether two of its doses are in the quick size.
    """

    name: str
    part: str
    what: str
    dose_unit: str
    doses: tuple[float, ...]
    judge: Judge
    how: InFactory | Computed
    methods: Mapping[str, Overrides] = field(default_factory=lambda: AS_IT_IS)
    compared: frozenset[str] = frozenset()
    quick: bool = False
