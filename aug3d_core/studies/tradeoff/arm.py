"""One way to make a scene as far as its figure needs, and its results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from aug3d_core.run.stage import Metric
from aug3d_core.store.record import Record
from aug3d_core.studies.common.cell import Result
from aug3d_core.studies.tradeoff.setting import Judge

Mark = Literal["", "preset", "auto"]
FACTORY = "the whole factory"
REFUSED = "refused"  # cause of a failure that is a valid result: the settings cannot be used on this scene
_TRUTH = ("town", "truth", "mesh_truth")  # users do not need these


@dataclass(frozen=True)
class TradeoffArm:
    """One value of a setting, or one configuration of the whole factory.

    panel: its chart: a setting's name, or FACTORY. label: its name there. settings: `stage.field=value`.
    stages: those whose time counts; empty for all that users need. seeded: seeds of stages, counted up by each repeat.
    """

    panel: str
    label: str
    settings: tuple[str, ...]
    judge: Judge
    stages: tuple[str, ...] = ()
    seeded: tuple[str, ...] = ()
    mark: Mark = ""

    @property
    def name(self) -> str:
        """Its name in progress messages and MLflow."""
        return f"{self.panel}: {self.label}"


@dataclass(frozen=True)
class TradeoffResult(Result[TradeoffArm]):
    """The result of an arm with a seed.

    found: how many of its objects existed before the study. figures: metrics of the judging stage, over all folds.
    held_out: PSNR [dB] of each test photograph, by its name.
    """

    found: int = 0
    figures: Mapping[str, Metric] = field(default_factory=dict, compare=False)
    held_out: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def paid(self) -> list[Record]:
        """The records whose cost counts, in all folds."""
        stages = self.arm.stages
        return [r for r in self.used if (r.stage in stages if stages else r.stage not in _TRUTH)]

    @property
    def costs(self) -> Mapping[str, float]:
        """Processor seconds of each stage that counts, in all folds, whenever it ran."""
        made = dict.fromkeys(record.stage for record in self.paid)
        return {stage: self.trial.cpu_seconds([stage]) for stage in self.arm.stages or made if stage in made}

    @property
    def peak_mib(self) -> float:
        """Highest memory of the stages that count [MiB]."""
        return max((record.peak_mib for record in self.paid), default=0.0)

    @property
    def size_bytes(self) -> int:
        """Size of the outputs of the stages that count."""
        return sum(record.size_bytes for record in self.paid)

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
        """What two scores must have in common to be compared; empty where nothing is held out.

        It is the photographs and, unless the judge accepts any, the size at which they are predicted. It is not their pixels:
        these depend on the size of working copies and on the estimated lens.
        """
        size = () if self.arm.judge.of_any_size else (self.size_px,)
        return (*size, *sorted(self.held_out)) if self.held_out else ()

    @property
    def size_px(self) -> tuple[object, object]:
        """Width and height of predicted pictures [px]."""
        packed = self.records["dataset"].config if "dataset" in self.records else {}
        return packed.get("width_px"), packed.get("height_px")

    def figure(self, name: str, per: str = "") -> float | None:
        """Return a figure of the judging stage as a number."""
        value, over = self.figures.get(name), self.figures.get(per) if per else 1.0
        if not isinstance(value, int | float):
            return None
        return float(value) / float(over) if isinstance(over, int | float) and over else None

    def as_json(self) -> dict[str, Any]:
        """Return the result for programs."""
        arm = {"panel": self.arm.panel, "label": self.arm.label}
        return {**arm, "accuracy": self.accuracy, "cause": self.trial.cause, **super().as_json()}
