"""What is done to the factory, and when a method counts as broken. Both are written down before anything is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from aug3d_core.run.stage import Metric
from aug3d_core.studies.stability.world import SMALL_TOWN

Overrides = tuple[str, ...]  # `stage.field=value`
AS_IT_IS: Mapping[str, Overrides] = {"as it is": ()}  # the methods of a perturbation that tries only one


@dataclass(frozen=True)
class Judge:
    """The figure that judges a method, and the mark past which it counts as broken.

    stage: the stage of the figure; empty for computed cells, which have only one. why: the reason for the mark.
    over: another figure of that stage, such as that of a cheap answer, which is subtracted.
    """

    metric: str
    better: Literal["higher", "lower"]
    mark: float
    why: str
    stage: str = ""
    over: str = ""

    @property
    def name(self) -> str:
        """Its name in tables."""
        return f"{self.metric} over {self.over}" if self.over else self.metric

    def figure(self, metrics: Mapping[str, Metric]) -> float | None:
        """Return the judged figure from the metrics of its stage; None if the stage lacks it."""
        values = [metrics.get(name) for name in (self.metric, self.over) if name]
        numbers = [float(value) for value in values if isinstance(value, int | float)]
        return numbers[0] - sum(numbers[1:]) if len(numbers) == len(values) else None

    def broken(self, accuracy: float | None) -> bool:
        """Say whether a method is broken. It is if it has no figure or the figure is NaN."""
        if accuracy is None:
            return True
        return not (accuracy >= self.mark if self.better == "higher" else accuracy <= self.mark)


@dataclass(frozen=True)
class Damage:
    """A damage to the output of a stage: `function` is "module:function" in `aug3d_core.studies.stability.damages`."""

    stage: str
    function: str


def no_settings(_dose: float) -> Overrides:
    """Set nothing."""
    return ()


@dataclass(frozen=True)
class InFactory:
    """The dose acts on a run of the factory on the town: through settings, or by damage to the output of a stage.

    until: the last stage of the run. settings: what a dose sets, after a method's own settings. seeded: settings that
    are set to the seed; a damage always gets it. world: the town. picture: the stage whose first picture shows the failure.
    """

    until: str
    settings: Callable[[float], Overrides] = no_settings
    damage: Damage | None = None
    seeded: tuple[str, ...] = ()
    world: Overrides = SMALL_TOWN
    picture: str = "sfm"

    def overrides(self, dose: float, method: Overrides, seed: int) -> Overrides:
        """Return what a cell sets: first its method, since another head brings settings of training with it."""
        return (*method, *(f"{field}={seed}" for field in self.seeded), *self.settings(dose))


@dataclass(frozen=True)
class Computed:
    """The cell is a function of dose, method and seed: "module:function" in this package, see `compute_stage`.

    Its outcome has the judged figure, the state that the factory would report, and perhaps a picture.
    """

    compute: str


@dataclass(frozen=True)
class Perturbation:
    """One way to make the work of one part of the factory harder.

    name: unique, few words, lower case. part: the chapter of the page. what: a sentence for people. doses: four or more,
    from harmless to ruinous, in `dose_unit`. methods: what is tried, by name, each with its settings.
    compared: methods that the factory does not offer, for comparison only; they are never silent.
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
