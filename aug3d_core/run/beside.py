"""Work that is done beside other work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import copy_context
from threading import Event, Thread


@contextmanager
def beside(work: Callable[[Event], None]) -> Iterator[None]:
    """Work in a thread while the block runs, with its context variables; at its end the event is set, and work waited for."""
    over = Event()
    working = Thread(target=copy_context().run, args=(work, over), daemon=True)
    working.start()
    try:
        yield
    finally:
        over.set()
        working.join()
