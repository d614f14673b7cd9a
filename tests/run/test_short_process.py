"""Garbage is looked for seldom, not never: a long run does not grow by it."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import gc, weakref
from aug3d_core.run.short_process import collect_seldom
class Loop: pass
def left():
    made = []
    for _ in range(1_000_000):
        loop = Loop(); loop.self = loop
        made.append(weakref.ref(loop))
    return sum(ref() is not None for ref in made)
usual = left()
collect_seldom()
print(usual, left())
"""


def test_loops_of_garbage_are_found() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    usual, seldom = map(int, done.stdout.split())
    assert usual < seldom < 300_000
