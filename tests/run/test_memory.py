"""Memory is what a container is given, where it is given less than the machine has."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest

from aug3d_core.run.memory import total_bytes

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
