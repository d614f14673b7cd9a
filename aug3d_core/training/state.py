"""A training run under way, and all of it that a later process needs to go on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import torch

from aug3d_core.heads.config import Measures
from aug3d_core.heads.head import Head, Start, build
from aug3d_core.training.config import TrainingConfig
from aug3d_core.training.divergence import Trouble
from aug3d_core.training.schedule import Probe


class Restart(NamedTuple):
    """Trouble that was met, and the step from which training began again."""

    trouble: Trouble
    again_from: int


@dataclass
class Run:
    """The head, its optimiser, and what has happened."""

    config: TrainingConfig
    head: Head
    optimiser: torch.optim.Adam
    history: list[Measures] = field(default_factory=list)  # of every step that counts
    probes: list[Probe] = field(default_factory=list)
    tail_from: int | None = None  # the step at which a plateau was found
    restarts: list[Restart] = field(default_factory=list)
    start: Start = field(default_factory=Start)  # what the head's first weights were
    seconds: float = 0.0  # of the steps in the history
    waited: float = 0.0  # seconds of these for batches

    @property
    def step(self) -> int:
        """Steps done."""
        return len(self.history)

    def state(self) -> dict[str, Any]:
        """Return what `load` takes: tensors, numbers and plain containers."""
        names = list(self.history[0]) if self.history else []
        return {
            "config": self.config.model_dump(mode="json"),
            "model": self.head.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "measures": names,
            "history": torch.tensor([[step[name] for name in names] for step in self.history], dtype=torch.float64),
            "probes": [tuple(probe) for probe in self.probes],
            "tail_from": self.tail_from,
            "restarts": [(tuple(restart.trouble), restart.again_from) for restart in self.restarts],
            "start": self.start.model_dump_json(),
            "seconds": (self.seconds, self.waited),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of this configuration."""
        self.head.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.history = [dict(zip(state["measures"], row, strict=True)) for row in state["history"].tolist()]
        self.probes = [Probe(*probe) for probe in state["probes"]]
        self.tail_from = state["tail_from"]
        self.restarts = [Restart(Trouble(*trouble), step) for trouble, step in state["restarts"]]
        self.start = Start.model_validate_json(state["start"])
        self.seconds, self.waited = state["seconds"]


def begin(config: TrainingConfig, device: torch.device, attempt: int = 0) -> Run:
    """Return a run of no steps with random weights; another attempt has others."""
    torch.manual_seed(config.seed + 1_000_003 * attempt)
    head = build(config.head).train().to(device)
    trained = [parameter for parameter in head.parameters() if parameter.requires_grad]
    return Run(config, head, torch.optim.Adam(trained, lr=config.learning_rate))


def start(run: Run) -> None:
    """Give the head the first weights that its settings name."""
    run.start = run.head.start()


def begin_again(run: Run) -> None:
    """Take a run back to no steps, with other weights; what is not trained stays as it is."""
    other = begin(run.config, run.head.device, attempt=len(run.restarts) + 1)
    start(other)
    state = other.state()
    state["model"] |= {name: value.data for name, value in run.head.named_parameters() if not value.requires_grad}
    run.load(state)
