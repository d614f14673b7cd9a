"""Run a configuration as far as a figure needs. What trials have in common is made once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.errors import StageFailed
from aug3d_core.make import Material, gather, make
from aug3d_core.scene_config import SceneConfig, scene_config
from aug3d_core.stage import Metric
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

Say = Callable[[str, int, int, str], None]  # stage, done, total, what


@dataclass(frozen=True)
class Trial:
    """The records of the stages that ran, by name, and why it ended early if it did."""

    records: Mapping[str, Record]
    failure: str = ""

    def seconds(self, stages: Iterable[str]) -> float:
        """Return the wall time of some stages, whenever they ran."""
        return sum(self.records[stage].seconds for stage in stages if stage in self.records)

    def peak_mib(self, stages: Iterable[str]) -> float:
        """Return the highest memory of some stages."""
        return max((self.records[stage].peak_mib for stage in stages if stage in self.records), default=0.0)

    def metric(self, stage: str, name: str) -> Metric:
        """Return a figure of a stage, None if the stage did not finish."""
        return self.records[stage].metrics[name] if stage in self.records else None


@dataclass(frozen=True)
class Measured:
    """What is measured: a preset, and settings that differ from it in every trial."""

    preset: str
    overrides: tuple[str, ...] = ()

    def config(self, more: Iterable[str] = ()) -> SceneConfig:
        """Return the configuration of a trial; raises UsageError that names a wrong setting."""
        return scene_config(self.preset, (*self.overrides, *more))


def run_trial(
    store: Store, until: str, scene: Measured, overrides: Iterable[str], say: Say, photos: Path | None = None
) -> Trial:
    """Make every stage up to and with `until`, of the town or of a folder of photographs.

    A stage that fails ends the trial, not the benchmark: where a setting breaks is a result.
    """
    config = scene.config(overrides)
    records: dict[str, Record] = {}
    material = Material(photos=photos)
    for stage in material.stages():
        sources = gather(store, stage, records, material)
        try:
            records[stage.name] = make(
                store,
                stage,
                getattr(config, stage.name),
                sources,
                lambda done, total, what, name=stage.name: say(name, done, total, what),
            )
        except StageFailed as failure:
            return Trial(records, failure.problem)
        if stage.name == until:
            break
    return Trial(records)
