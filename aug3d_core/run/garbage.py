"""When Python looks for garbage: seldom in a process that lives for one command, and apart from the work in a server."""

from __future__ import annotations

import atexit
import gc
import time
from itertools import count
from threading import Thread

_OBJECTS, _ROUNDS = 100_000, 50  # Python's own: 700, 10
_APART_EVERY_S, _WHOLE_EVERY = 10.0, 30


def collect_seldom() -> None:
    """Look for garbage seldom, and not at the end: imports make hundreds of thousands of objects, none of them garbage.

    Measured on the imports of a run and its end: 3.4 processor s, and 1.7 s with this.
    """
    gc.set_threshold(_OBJECTS, _ROUNDS, _ROUNDS)
    atexit.register(gc.freeze)  # else the end looks through all of them again


def collect_apart(every_s: float = _APART_EVERY_S) -> None:
    """Look for garbage in a thread of its own from now on; what there is now is none.

    Where SQLite refused a statement, since it was locked, its cursor is left to the garbage collector, and whoever lets go of
    a cursor waits while its connection waits for the lock. Done by the thread that serves, that stopped Prefect's server for
    a minute at a time: the lock was its own, in a transaction that it could not go on with.

    What has outlived one look is looked through again only every 5 minutes: every 10 s it took a quarter of the processor
    time of an idle server of Prefect's, 7.6 s a minute and 5.6 without.
    """
    gc.disable()
    gc.freeze()
    atexit.register(gc.freeze)
    Thread(target=_collect, args=(every_s,), daemon=True).start()


def _collect(every_s: float) -> None:
    for look in count(1):
        time.sleep(every_s)
        gc.collect(2 if look % _WHOLE_EVERY == 0 else 1)
