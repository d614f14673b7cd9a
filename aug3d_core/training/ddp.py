"""Several processes that train one model, one for each device: each draws the same batch and takes its own groups.

Gradients are averaged by torch's DistributedDataParallel. What decisions rest on is averaged too, so that all members
decide alike. The stage's process is the first member: it alone reports and writes.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, distributed, nn
from torch.nn.parallel import DistributedDataParallel

from aug3d_core.dataset.batches import Group


@dataclass(frozen=True)
class Team:
    """One member's view of the team."""

    rank: int = 0
    size: int = 1

    @property
    def device(self) -> torch.device:
        """The member's own device."""
        return torch.device("cuda", self.rank) if torch.cuda.is_available() else torch.device("cpu")

    @property
    def leads(self) -> bool:
        """Whether this member writes checkpoints."""
        return self.rank == 0

    def share(self, groups: Sequence[Group]) -> tuple[Group, ...]:
        """Return this member's groups of a step."""
        return tuple(groups[self.rank :: self.size])

    def wrap(self, module: nn.Module) -> nn.Module:
        """Let gradients be averaged over members."""
        # A step that starts from a scaffold does without the parts of the plane sweep that search one
        return DistributedDataParallel(module, find_unused_parameters=True) if self.size > 1 else module

    def mean(self, values: Tensor) -> Tensor:
        """Average values over members."""
        if self.size > 1:
            distributed.all_reduce(values)
        return values / self.size

    def wait(self) -> None:
        """Wait for all members."""
        if self.size > 1:
            distributed.barrier()


ALONE = Team()


def fitting_size(groups_per_step: int, devices: int) -> int:
    """Return how many members can have equally many groups: the most that divide them."""
    return max(size for size in range(1, max(devices, 1) + 1) if groups_per_step % size == 0)


@contextmanager
def gathered(size: int, follow: Callable[..., object], *arguments: object) -> Iterator[Team]:
    """Start the other members, each calling follow(team, *arguments), and yield the first one's view of the team."""
    if size == 1:
        yield ALONE
        return
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        meeting = str(Path(folder) / "meeting")
        others = [
            context.Process(target=_member, args=(rank, size, meeting, follow, arguments), daemon=True)
            for rank in range(1, size)
        ]
        for other in others:
            other.start()
        try:
            with _joined(0, size, meeting) as team:
                yield team
        finally:
            for other in others:
                other.join(10)
                other.kill()


def _member(rank: int, size: int, meeting: str, follow: Callable[..., object], arguments: tuple) -> None:
    with _joined(rank, size, meeting) as team:
        follow(team, *arguments)


@contextmanager
def _joined(rank: int, size: int, meeting: str) -> Iterator[Team]:
    team = Team(rank, size)
    if team.device.type == "cuda":
        torch.cuda.set_device(team.device)
    backend = "nccl" if team.device.type == "cuda" else "gloo"
    # All members are on this machine: nobody else may listen in
    os.environ.update(NCCL_SOCKET_IFNAME="lo", GLOO_SOCKET_IFNAME="lo")
    distributed.init_process_group(backend, init_method=f"file://{meeting}", rank=rank, world_size=size)
    try:
        yield team
    finally:
        distributed.destroy_process_group()
