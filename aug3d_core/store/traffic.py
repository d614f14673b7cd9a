"""What was asked of a shared store: requests by kind, and bytes. Stores bill both."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_MIB = 2**20


@dataclass(frozen=True)
class Traffic:
    """Requests by kind (get, head, put, list, delete), and bytes of content up and down."""

    requests: Mapping[str, int] = field(default_factory=dict)
    bytes_up: int = 0
    bytes_down: int = 0

    def since(self, before: Traffic) -> Traffic:
        """Return what came after an earlier look."""
        requests = Counter(self.requests)
        requests.subtract(before.requests)
        counts = {kind: count for kind, count in sorted(requests.items()) if count}
        return Traffic(counts, self.bytes_up - before.bytes_up, self.bytes_down - before.bytes_down)

    def told(self) -> dict[str, Any]:
        """Return it as `metrics.json` has it."""
        up, down = (round(count / _MIB, 3) for count in (self.bytes_up, self.bytes_down))
        return {"requests": dict(self.requests), "mib_up": up, "mib_down": down}


class Tally:
    """Counts traffic; any number of threads at once."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._requests: Counter[str] = Counter()
        self._up = self._down = 0

    def add(self, kind: str, requests: int = 1, up: int = 0, down: int = 0) -> None:
        """Count requests of a kind, and bytes."""
        with self._lock:
            self._requests[kind] += requests
            self._up += up
            self._down += down

    def traffic(self) -> Traffic:
        """Return what was counted so far."""
        with self._lock:
            return Traffic(dict(self._requests), self._up, self._down)
