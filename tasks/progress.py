"""Tell whoever listens how far the work is: the command line's live table, a test, or nobody."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from aug3d_core.run.stage import Progress

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit


class Listener(Protocol):
    """What a display of progress understands."""

    def started(self, step: str) -> None:
        """A step begins (it may turn out to be cached)."""

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """A step has done `done` of `total`."""

    def finished(self, made: Visit) -> None:
        """A step's object is there."""


_listeners: list[Listener] = []


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Send progress to a listener while the block runs."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def started(step: str) -> None:
    """Pass on that a step begins."""
    for listener in _listeners:
        listener.started(step)


def finished(made: Visit) -> None:
    """Pass on that a step's object is there."""
    for listener in _listeners:
        listener.finished(made)


def reporter(step: str) -> Progress:
    """Return the progress function of a step."""

    def advanced(done: int, total: int, what: str) -> None:
        for listener in _listeners:
            listener.advanced(step, done, total, what)

    return advanced
