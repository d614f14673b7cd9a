"""One thread that does what was asked last, one at a time: what was asked meanwhile and is no longer wanted is left out."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

STILL_S = 0.2  # nothing newer for so long: the camera stands
_GOOD_BYE_S = 2.0
_Asked = TypeVar("_Asked")


class Latest(Generic[_Asked]):
    """Calls `do(asked, still)` with the newest that was asked; once more with `still` when nothing newer came."""

    def __init__(self, do: Callable[[_Asked, bool], None], still_s: float = STILL_S) -> None:
        self._do, self._still_s = do, still_s
        self._waiting: list[_Asked] = []  # the newest alone
        self._ended = False
        self._told = threading.Condition()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, what: _Asked) -> None:
        """Ask for this in place of all that was not begun."""
        with self._told:
            self._waiting = [what]
            self._told.notify()

    def end(self) -> None:
        """Begin nothing more, and wait a moment for what is being done: a view of a slow head takes minutes."""
        with self._told:
            self._ended = True
            self._told.notify()
        self._thread.join(_GOOD_BYE_S)

    def _run(self) -> None:
        while (what := self._next(None)) is not None:
            self._do(what[0], False)
            while (newer := self._next(self._still_s)) is not None and newer:
                what = newer
                self._do(what[0], False)
            if newer is None:
                return
            self._do(what[0], True)

    def _next(self, most_s: float | None) -> list[_Asked] | None:
        """Return the newest, or nothing if none comes in time; None once it has ended."""
        with self._told:
            self._told.wait_for(lambda: self._waiting or self._ended, most_s)
            if self._ended:
                return None
            what, self._waiting = self._waiting, []
            return what
