"""The batches of a training, the next one drawn and read from disk while the present one is learned from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from aug3d_core.dataset.batches import Group, Wanted, draw
from aug3d_core.dataset.on_disk import OnDisk
from aug3d_core.dataset.scene import PICTURES, Scene

Groups = tuple[Group, ...]


class Ahead:
    """Batches by their seeds alone: what was read ahead changes nothing but the wait. share: this process's part of one."""

    def __init__(self, scenes: Sequence[Scene], wanted: Wanted, share: Callable[[Groups], Groups]) -> None:
        self._scenes, self._wanted, self._share = scenes, wanted, share
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="batches")
        self._next: tuple[list[int], Future[Groups]] | None = None

    def draw(self, seeds: list[int]) -> Groups:
        """Return the batch of a step, the last of the seeds, and begin to read that of the step after it."""
        ahead, self._next = self._next, None
        groups = ahead[1].result() if ahead and ahead[0] == seeds else self.fixed(seeds)
        following = [*seeds[:-1], seeds[-1] + 1]
        self._next = following, self._reader.submit(self.fixed, following)
        return groups

    def fixed(self, seeds: list[int]) -> Groups:
        """Return the batch of some seeds, read."""
        groups = self._share(draw(self._scenes, self._wanted, np.random.default_rng(seeds)))
        for group in groups:
            views = np.concatenate([group.inputs, group.targets])
            for name in PICTURES:
                array = getattr(self._scenes[group.scene], name)
                if isinstance(array, OnDisk):
                    array.fetch(group.inputs if name == "fine_images" else views)
        return groups
