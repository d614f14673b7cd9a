"""What processes share is counted once, and looking costs little."""

from __future__ import annotations

import os
import time
from typing import Any

import psutil
import pytest

from aug3d_core.run import memory_meter
from aug3d_core.run.memory_meter import MemoryMeter


class Process(psutil.Process):
    """A process whose memory a test sets [bytes]."""

    def __init__(self, rss: int, pss: int, refused: bool = False) -> None:
        super().__init__()
        self.rss, self.pss, self.refused, self.looks = rss, pss, refused, 0

    def memory_info(self) -> Any:
        return self

    def memory_full_info(self) -> Any:
        self.looks += 1
        if self.refused:
            raise psutil.AccessDenied
        return self


def peak(*job: Process) -> int:
    meter = MemoryMeter(1e9)
    meter.look(job)
    return meter.peak_bytes


def test_shares_are_added() -> None:
    assert peak(Process(100, 60), Process(90, 50)) == 110


def test_without_shares_resident_memory_counts() -> None:
    assert peak(Process(100, 60, refused=True), Process(90, 50)) == 150


@pytest.mark.skipif(not hasattr(psutil.Process().memory_full_info(), "pss"), reason="the kernel tells no shares")
def test_a_forked_child_that_writes_nothing_adds_next_to_nothing() -> None:
    block = bytearray(64 * 2**20)
    block[::4096] = b"1" * len(block[::4096])
    alone = MemoryMeter(1e12)
    alone.look([psutil.Process()])
    child = os.fork()
    if child == 0:
        time.sleep(60)
        os._exit(0)
    both = MemoryMeter(1e12)
    both.look([psutil.Process(), psutil.Process(child)])
    os.kill(child, 9)
    os.waitpid(child, 0)
    assert both.peak_bytes < alone.peak_bytes + 32 * 2**20


def test_it_rests_fifty_times_as_long_as_a_look_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]

    class Slow(Process):
        def memory_full_info(self) -> Any:
            now[0] += 1.0
            return super().memory_full_info()

    monkeypatch.setattr(memory_meter.time, "monotonic", lambda: now[0])
    meter, process = MemoryMeter(1e9), Slow(100, 50)
    for second in range(0, 205):
        now[0] = max(now[0], float(second))
        meter.look([process])
    assert process.looks == 5


def test_it_does_not_look_again_while_the_job_cannot_have_grown() -> None:
    meter, process = MemoryMeter(1e9), Process(100, 100)
    for _ in range(100):
        meter.look([process])
    assert process.looks == 1


def test_it_looks_at_once_where_the_limit_may_be_passed() -> None:
    meter, process = MemoryMeter(1000), Process(900, 500)
    meter.look([process])
    meter._rested_at = float("inf")
    process.rss, process.pss = 1390, 990
    meter.look([process])
    assert meter.peak_bytes == 500, "400 are shared: it may not be passed yet"
    process.rss, process.pss = 1410, 1010
    meter.look([process])
    assert meter.peak_bytes == 1010
