"""A training run under way, and all of it that a later process needs to go on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import torch

from aug3d_core.heads.pixelnerf.config import TrainingConfig
from aug3d_core.heads.pixelnerf.encoder import PaperEncoder
from aug3d_core.heads.pixelnerf.encoder_weights import start_trunk
from aug3d_core.heads.pixelnerf.model import PixelNeRF
from aug3d_core.training.divergence import Measures, Trouble
from aug3d_core.training.schedule import Probe


class Restart(NamedTuple):
    """Trouble that was met, and the step from which training began again."""

    trouble: Trouble
    again_from: int


@dataclass
class Run:
    """The model, its optimiser, and what has happened."""

    model: PixelNeRF
    optimiser: torch.optim.Adam
    history: list[Measures] = field(default_factory=list)  # of every step that counts
    probes: list[Probe] = field(default_factory=list)
    tail_from: int | None = None  # the step at which a plateau was found
    restarts: list[Restart] = field(default_factory=list)
    encoder_from: str = "random"  # where the encoder's first weights came from, in words
    seconds: float = 0.0  # of the steps in the history
    waited: float = 0.0  # seconds of these for batches

    @property
    def step(self) -> int:
        """Steps done."""
        return len(self.history)

    def state(self) -> dict[str, Any]:
        """Return what `load` takes: tensors, numbers and plain containers."""
        return {
            "config": self.model.config.model_dump(mode="json"),
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "history": torch.tensor(self.history, dtype=torch.float64).reshape(-1, len(Measures._fields)),
            "probes": [tuple(probe) for probe in self.probes],
            "tail_from": self.tail_from,
            "restarts": [(tuple(restart.trouble), restart.again_from) for restart in self.restarts],
            "encoder_from": self.encoder_from,
            "seconds": (self.seconds, self.waited),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of this configuration."""
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.history = [Measures(*row) for row in state["history"].tolist()]
        self.probes = [Probe(*probe) for probe in state["probes"]]
        self.tail_from = state["tail_from"]
        self.restarts = [Restart(Trouble(*trouble), step) for trouble, step in state["restarts"]]
        self.encoder_from = state["encoder_from"]
        self.seconds, self.waited = state["seconds"]


def begin(config: TrainingConfig, device: torch.device, attempt: int = 0) -> Run:
    """Return a run of no steps with random weights; another attempt has others."""
    torch.manual_seed(config.seed + 1_000_003 * attempt)
    model = PixelNeRF(config).train().to(device)
    if config.encoder_frozen:
        model.encoder.requires_grad_(False)
    trained = [parameter for parameter in model.parameters() if parameter.requires_grad]
    return Run(model, torch.optim.Adam(trained, lr=config.learning_rate))


def start_encoder(run: Run) -> None:
    """Give the paper's encoder the weights that the configuration names."""
    encoder = run.model.encoder
    if isinstance(encoder, PaperEncoder):
        run.encoder_from = start_trunk(encoder.trunk, run.model.config.encoder_weights)


def begin_again(run: Run) -> None:
    """Take a run back to no steps, with other weights; a frozen encoder stays as it is, for its maps are kept."""
    config = run.model.config
    other = begin(config, run.model.device, attempt=len(run.restarts) + 1)
    start_encoder(other)
    state = other.state()
    if config.encoder_frozen:
        kept = {name: value for name, value in run.model.state_dict().items() if name.startswith("encoder.")}
        state["model"] |= kept
    run.load(state)
