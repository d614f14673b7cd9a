"""One way to make a scene, as far as its figure needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from aug3d_core.bench.trial import Trial
from aug3d_core.stage import Metric
from aug3d_core.tradeoff.setting import Judge

Mark = Literal["", "preset", "auto"]
FACTORY = "the whole factory"
REFUSED = "refused"  # the cause of a failure that is an answer: these settings cannot be used on this scene
_TRUTH = ("town", "truth", "mesh_truth")  # what users have no need to pay for


@dataclass(frozen=True)
class Arm:
    """One value of a setting, or one configuration of the whole factory.

    panel: what it is charted with: a setting's name, or FACTORY. label: its name there. settings: `stage.field=value`.
    stages: those whose time counts, empty for all that users pay for. seeded: settings that a repeat sets to its number.
    """

    panel: str
    label: str
    settings: tuple[str, ...]
    judge: Judge
    stages: tuple[str, ...] = ()
    seeded: tuple[str, ...] = ()
    mark: Mark = ""


@dataclass(frozen=True)
class Result:
    """What became of an arm with a seed.

    found: how many of its objects were made before the study. figures: what the judging stage measured, over all folds.
    held_out: PSNR (dB) of each test photograph, by its name.
    """

    arm: Arm
    seed: int
    trial: Trial
    found: int = 0
    figures: Mapping[str, Metric] = field(default_factory=dict, compare=False)
    held_out: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def name(self) -> str:
        """How progress and MLflow call it."""
        return f"{self.arm.panel}: {self.arm.label}, seed {self.seed}"

    @property
    def costs(self) -> Mapping[str, float]:
        """Processor seconds of each stage that counts, in all folds, whenever it ran."""
        return {stage: self.trial.cpu_seconds([stage]) for stage in self._paid}

    @property
    def cpu_seconds(self) -> float:
        """Processor seconds of all stages that count."""
        return sum(self.costs.values())

    @property
    def seconds(self) -> float:
        """Wall seconds of all stages that count, which other work on the machine lengthens."""
        return self.trial.seconds(self._paid)

    @property
    def peak_mib(self) -> float:
        """Highest memory of the stages that count."""
        return self.trial.peak_mib(self._paid)

    @property
    def size_bytes(self) -> int:
        """Bytes that the outputs of the stages that count occupy."""
        return sum(record.size_bytes for record in self.trial.of(self._paid))

    @property
    def accuracy(self) -> float | None:
        """The figure of the judge, None where the arm has none."""
        return self.figure(self.arm.judge.figure, self.arm.judge.per)

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval of a test's PSNR over its photographs."""
        low, high = (self.figure(f"test_psnr_ci_{end}") for end in ("low", "high"))
        return (
            (low, high) if self.arm.judge.figure == "test_psnr_mean" and low is not None and high is not None else None
        )

    @property
    def test(self) -> tuple[object, ...]:
        """What a score must have in common with another to be compared with it; empty where nothing is held out.

        The photographs and, unless the judge takes any, the size they are predicted at, but not their pixels: working copies
        of different sizes, and lenses found a little differently, make these different.
        """
        size = () if self.arm.judge.of_any_size else (self.size_px,)
        return (*size, *sorted(self.held_out)) if self.held_out else ()

    @property
    def size_px(self) -> tuple[object, object]:
        """Width and height of what is predicted."""
        packed = self.trial.records["dataset"].config if "dataset" in self.trial.records else {}
        return packed.get("width_px"), packed.get("height_px")

    @property
    def notes(self) -> tuple[str, ...]:
        """What its stages warn of."""
        return tuple(
            f"{step}: {note}"
            for step, record in self.trial.records.items()
            if record.state == "degraded"
            for note in record.notes
        )

    def figure(self, name: str, per: str = "") -> float | None:
        """Return a figure of the judging stage as a number."""
        value, over = self.figures.get(name), self.figures.get(per) if per else 1.0
        if not isinstance(value, int | float):
            return None
        return float(value) / float(over) if isinstance(over, int | float) and over else None

    @property
    def _paid(self) -> list[str]:
        made = dict.fromkeys(record.stage for record in self.trial.records.values())
        if self.arm.stages:
            return [stage for stage in self.arm.stages if stage in made]
        return [stage for stage in made if stage not in _TRUTH]
