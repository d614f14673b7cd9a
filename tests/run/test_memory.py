"""Memory is what a container is given, where it is given less than the machine has."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from aug3d_core.run.memory import MemoryBudget, total_bytes

MACHINE = psutil.virtual_memory().total


@pytest.mark.parametrize(
    ("file", "told", "expected"),
    [
        ("memory.max", "1000000\n", 1_000_000),
        ("memory.max", "max\n", MACHINE),
        ("memory/memory.limit_in_bytes", "2000000", 2_000_000),
        ("memory/memory.limit_in_bytes", str(2**63 - 4096), MACHINE),  # version 1 says so for no limit
    ],
)
def test_a_limit_counts_where_it_is_less(file: str, told: str, expected: int, tmp_path: Path) -> None:
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(told)
    assert total_bytes(tmp_path) == expected


def test_without_a_limit_it_is_the_machines(tmp_path: Path) -> None:
    assert total_bytes(tmp_path) == MACHINE


def test_threads_never_hold_more_than_the_budget() -> None:
    budget, held, most = MemoryBudget(10), 0, 0
    guard = threading.Lock()

    def work(needed: int) -> None:
        nonlocal held, most
        with budget.taking(needed):
            with guard:
                held += needed
                most = max(most, held)
            time.sleep(0.002)
            with guard:
                held -= needed

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, [3, 4, 5, 10, 1, 7] * 8))
    assert 7 <= most <= 10


def test_more_than_the_whole_budget_is_refused_and_takes_nothing() -> None:
    budget = MemoryBudget(10)
    with pytest.raises(ValueError, match="11 bytes are more"), budget.taking(11):
        pass
    with budget.taking(10):
        pass
