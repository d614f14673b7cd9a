"""One malformed input at a time: what became of it, within a time limit."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.picture import PictureError

LIMIT_S = 20.0
REFUSED, RIGHT, HANG, TRACEBACK, SILENT = "refused", "right", "hang", "traceback", "silent"


@dataclass(frozen=True)
class Attack:
    """A malformed input. call: gives it to its reader. right: whether a result is; names: what a refusal must say."""

    name: str
    call: Callable[[], Any]
    names: str = ""
    right: Callable[[Any], bool] = lambda _: False


def verdict(attack: Attack, limit_s: float = LIMIT_S) -> tuple[str, str]:
    """Return what became of an input, and what was said."""
    end: list[Any] = []

    def run() -> None:
        try:
            end.append(attack.call())
        except BaseException as error:
            end.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(limit_s)
    if not end:
        return HANG, f"no answer in {limit_s:g} s"
    (told,) = end
    if isinstance(told, Aug3dError | PictureError):
        # What cannot be used has a reason; the table beside it holds the name.
        named = attack.names in str(told) and bool(str(told).strip())
        return (REFUSED if named else SILENT), str(told)
    if isinstance(told, BaseException):
        return TRACEBACK, f"{type(told).__name__}: {told}"
    return (RIGHT if attack.right(told) else SILENT), repr(told)[:300]


def assert_withstood(attacks: Iterable[Attack], least: int) -> Counter[str]:
    """Try every input; fails with a list of those that hung, gave a traceback, or were taken in silence."""
    counts: Counter[str] = Counter()
    bad = []
    for attack in attacks:
        what, said = verdict(attack)
        counts[what] += 1
        if what not in (REFUSED, RIGHT):
            bad.append(f"{what}: {attack.name}: {said[:300]}")
    assert not bad, f"{len(bad)} of {counts.total()}:\n" + "\n".join(bad)
    assert counts.total() >= least
    return counts


_CHILD = """
import importlib, json, sys, threading
from tests.attack.inputs import Attack, verdict
from tests.attack import readers
for line in sys.stdin:
    reader, path = json.loads(line)
    print(json.dumps(verdict(Attack(path, lambda: getattr(readers, reader)(path), "", lambda told: told))), flush=True)
import os
os._exit(0)  # a reader that hangs does not keep the process
"""


def in_own_process(given: Sequence[tuple[str, Path]]) -> list[tuple[str, str]]:
    """Return the verdicts of readers that load an engine, which has a process of its own; a crash ends the list early.

    given: a function of `readers` and what it reads.
    """
    lines = "".join(json.dumps((reader, str(path))) + "\n" for reader, path in given)
    done = subprocess.run(
        [sys.executable, "-c", _CHILD],
        input=lines,
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
        timeout=600,
    )
    found = [tuple(json.loads(line)) for line in done.stdout.splitlines() if line.startswith("[")]
    return found + [(TRACEBACK, f"the process ended: {done.stderr[-500:]}")] * (len(given) - len(found))
