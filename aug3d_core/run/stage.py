"""What a stage is: its configuration, its inputs, the function that does the work, and what that function reports.

A stage function has the shape `run(inputs, config, out, progress) -> Outcome`:

* `inputs`  maps the name of each upstream stage to the folder with its files,
* `config`  is the stage's own frozen pydantic model,
* `out`     is the folder to write into; if the stage is resumable it may hold what a killed run left behind,
* `progress(done, total, what)` tells how far the work is.

The function knows nothing of keys, caches or processes; `factory/build.py` and `process.py` see to those.
"""

from __future__ import annotations

import importlib
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator

from aug3d_core.run.metric import MetricSpec

State = Literal["ok", "degraded"]
Metric = float | int | str | bool | None
Inputs = Mapping[str, Path]
Progress = Callable[[int, int, str], None]
T = TypeVar("T")
Order = Callable[[Sequence[int]], list[int]]  # in which shards are made: `list`, or `from_elsewhere`


class Frozen(BaseModel):
    """Base of every record and configuration: immutable, and strict about unknown fields.

    A field's title in a form is its name: the one that files and `--set` take.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", field_title_generator=lambda name, _: name)


class StageConfig(Frozen):
    """Base of a stage's configuration. Each field has a unit, bounds and a sentence; its numbers are finite."""

    model_config = ConfigDict(allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse what pydantic takes for 1 and 0: in YAML yes, no, on and off are truth values."""
        kind = cls.model_fields[info.field_name or ""].annotation
        if isinstance(value, bool) and bool not in (kind, *get_args(kind)):
            raise ValueError("cannot be true or false; in YAML that is also what yes, no, on and off say")
        return value

    @property
    def engines(self) -> tuple[str, ...]:
        """The engines that these settings ask for besides the stage's own."""
        return ()

    @property
    def modules(self) -> tuple[str, ...]:
        """The code, "module" or "module:name", that these settings ask for besides the stage's own: it is part of the key."""
        return ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that these settings name: what is in them is part of the key."""
        return ()


class Decision(Frozen):
    """Why a setting has its value, in plain sentences with figures.

    field: `stage.field`, or what a stage chose by itself. saves: what it saves; costs: what it may cost. "" if nobody
    measured it.
    """

    field: str
    value: Metric
    measured: str
    rule: str
    saves: str = ""
    costs: str = ""


AS_SET = "as set"  # the rule of a decision that the settings made


class Outcome(Frozen):
    """What a stage function reports.

    metrics: figures by name, with the unit in the name (`reprojection_px`).
    state: `degraded` when the output is usable but something the user should know went wrong; `notes` then say what.
    series: curves by name, each a tuple of (step, value).
    pictures: caption -> path relative to `out` of the images that people should look at.
    decisions: what the stage chose by itself, or what was set in its place.
    """

    metrics: dict[str, Metric]
    state: State = "ok"
    notes: tuple[str, ...] = ()
    series: dict[str, tuple[tuple[int, float], ...]] = {}
    pictures: dict[str, str] = {}
    decisions: tuple[Decision, ...] = ()


@dataclass(frozen=True)
class Stage:
    """One step of the factory.

    name: also the folder name in the store and the name in `SceneConfig`.
    config: the configuration model.
    inputs: names of the upstream stages whose files it reads.
    reads: of an input, the only files that it reads, where it does not read them all: the others may change, and what it made
        stays good.
    runs: inputs whose code it runs, the modules that their settings name: a trained model is run by the code of its head.
    entry: "module:function" of the stage function; imported only in the stage's own process.
    engines: distributions whose version is part of the cache key: those that compute what is in its files and figures.
    accuracy: the metric that says how well the stage did, shown in every table.
    resumable: keep a killed run's partial files and hand them to the next try.
    shards: patterns of partial files that are whole from the moment they have their name, in the order in which they are
        written; another machine that takes the work over goes on with them.
    assist: "module:function" of a stage function that only makes shards, those that are not there yet, in an order of its
        own: for a machine that helps another one. `entry` uses shards that come up while it works.
    grows: hand over what the same recipe (code, configuration, engines) made of other inputs before: `inputs["earlier"]`
        is then a folder of such outputs, newest first by name. It is no part of the key: use it to save work. Where the
        answer then differs from a fresh one, within the accuracy of the stage, a metric says what it grew from.
    afresh: a key of its own, for an answer that must not have grown.
    description: what the stage is about, one sentence; the form shows it.
    presets: its settings by the name of the preset; empty for a stage that no run has.
    metrics: the figures that it reports, by name; `accuracy` is one of them.
    decidable: fields of `config` that the preset `auto` leaves open, to be decided from the scene.
    alone: it uses the whole machine for long; one at a time runs in a store, of however many scenes.
    """

    name: str
    config: type[StageConfig]
    inputs: tuple[str, ...]
    entry: str
    engines: tuple[str, ...]
    accuracy: str
    description: str = ""
    presets: Mapping[str, StageConfig] = field(default_factory=dict, hash=False)
    metrics: Mapping[str, MetricSpec] = field(default_factory=dict, hash=False)
    decidable: tuple[str, ...] = ()
    resumable: bool = False
    shards: tuple[str, ...] = ()
    assist: str = ""
    grows: bool = False
    afresh: bool = False
    alone: bool = False
    reads: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    runs: tuple[str, ...] = ()

    @property
    def package(self) -> str:
        """The package whose `python -m` replays this stage."""
        return self.entry.partition(":")[0].rpartition(".")[0]


def from_elsewhere(shards: Sequence[T]) -> list[T]:
    """Return shards in an order of one's own: backwards from a random place. Who goes forward from the first is met late."""
    place = secrets.randbelow(len(shards)) if shards else 0
    return [*reversed(shards[: place + 1]), *reversed(shards[place + 1 :])]


def stage_function(entry: str) -> Callable[[Inputs, Any, Path, Progress], Outcome]:
    """Import a stage function by its "module:function", and with it the engine that it needs."""
    module, _, name = entry.partition(":")
    return getattr(importlib.import_module(module), name)
