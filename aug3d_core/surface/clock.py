"""What each step took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass
class Clock:
    """Seconds by step."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Count the time of a block under a name."""
        start = time.monotonic()
        yield
        self.add(Clock({name: time.monotonic() - start}))

    def add(self, *others: Clock) -> None:
        """Count what others have counted, whether it was at the same time or not."""
        for other in others:
            for name, spent in other.seconds.items():
                self.seconds[name] = self.seconds.get(name, 0.0) + spent
