"""Garbage is looked for seldom, not never: a long run does not grow by it. And apart, where looking for it stopped a server."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

LOOPS = """
import gc, sys, time, weakref
from aug3d_core.run import garbage
class Loop: pass
def left(wait_s=0.0):
    made = []
    for _ in range(1_000_000):
        loop = Loop(); loop.self = loop
        made.append(weakref.ref(loop))
    time.sleep(wait_s)
    return sum(ref() is not None for ref in made)
usual = left()
if sys.argv[1] == "seldom":
    garbage.collect_seldom()
    print(usual, left())
else:
    garbage.collect_apart(0.2)
    print(usual, left(3.0))
"""
# A loop that outlives looks, and only then is garbage
OLD = """
import time, weakref
from aug3d_core.run import garbage
garbage._WHOLE_EVERY = 10
garbage.collect_apart(0.05)
class Loop: pass
loop = Loop(); loop.self = loop
told = weakref.ref(loop)
time.sleep(0.3)
del loop
until = time.monotonic() + 30
while told() is not None and time.monotonic() < until:
    time.sleep(0.05)
print(told())
"""
# One connection holds the lock for writing and another waits for it in a thread; a cursor of that one, which was refused
# before, is garbage.
LOCKED = """
import sqlite3, sys, time
from threading import Thread
from aug3d_core.run.garbage import collect_apart
if sys.argv[2] == "apart":
    collect_apart(0.1)
first, second = (sqlite3.connect(sys.argv[1], timeout=0, isolation_level=None, check_same_thread=False) for _ in "ab")
first.execute("PRAGMA journal_mode = WAL")
first.execute("CREATE TABLE numbers (n)")
class Loop: pass
left = Loop(); left.self = left
left.cursor = second.cursor()
first.execute("BEGIN IMMEDIATE")
try:
    left.cursor.execute("INSERT INTO numbers VALUES (1)")
except sqlite3.OperationalError:
    second.execute("PRAGMA busy_timeout = 3000")
def write():
    try:
        second.execute("INSERT INTO numbers VALUES (1)")
        print("written")
    except sqlite3.OperationalError as error:
        print(error)
writing = Thread(target=write)
writing.start()
time.sleep(0.5)
del left
kept = [[] for _ in range(100_000)]
time.sleep(0.5)
first.execute("COMMIT")
writing.join()
"""


def told_by(script: str, *words: str) -> str:
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize(("way", "most"), [("seldom", 300_000), ("apart", 10)])
def test_loops_of_garbage_are_found(way: str, most: int) -> None:
    usual, left = map(int, told_by(LOOPS, way).split())
    assert usual < 100_000 and left <= most
    assert way == "apart" or usual < left


def test_what_becomes_garbage_late_is_found_too() -> None:
    assert told_by(OLD) == "None"


@pytest.mark.parametrize(("way", "told"), [("usual", "database is locked"), ("apart", "written")])
def test_a_cursor_that_is_garbage_stops_nobody_who_holds_a_lock(way: str, told: str, tmp_path: Path) -> None:
    assert told_by(LOCKED, str(tmp_path / "some.db"), way) == told
