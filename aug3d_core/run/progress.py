"""Progress reports from a thread of their own, so that whoever listens can neither hold up nor end the work."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import copy_context

from aug3d_core.run.stage import Progress

_LAST_S = 2.0  # how long the end of the work waits for a listener
_LOG = logging.getLogger(__name__)


@contextmanager
def on_the_side(progress: Progress) -> Iterator[Progress]:
    """Give a function that returns at once and has `progress` called, in the caller's context, with the newest report.

    What is older and not yet told is passed over, the last report is told before the block ends unless the listener is
    too slow. A listener that raises is logged.
    """
    newest: deque[tuple[int, int, str]] = deque(maxlen=1)
    news, ended = threading.Event(), threading.Event()

    def report(done: int, total: int, what: str) -> None:
        newest.append((done, total, what))
        news.set()

    def tell() -> None:
        last = False
        while not last:
            news.wait()
            news.clear()
            last = ended.is_set()
            if newest:
                with failures_logged():
                    progress(*newest.pop())

    teller = threading.Thread(target=copy_context().run, args=(tell,), daemon=True)
    teller.start()
    try:
        yield report
    finally:
        ended.set()
        news.set()
        teller.join(_LAST_S)
        newest.clear()


@contextmanager
def failures_logged() -> Iterator[None]:
    """Log what telling a listener raises, and go on."""
    try:
        yield
    except Exception as error:
        _LOG.warning("progress could not be reported: %s: %s", type(error).__name__, error)
