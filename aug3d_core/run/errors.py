"""Errors that people read: each says what is wrong, with the offending value, and what to do about it."""

from __future__ import annotations

from typing import Any

_LONGEST_VALUE = 80


def shown(value: Any) -> str:
    """Return a value as errors quote it: cut where it is long, since whoever sent it may have sent a book."""
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."


class Aug3dError(Exception):
    """A failure with a cause that a user can act on.

    `problem` names the file or value at fault; `remedy` is one sentence that says what to do.
    """

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem, remedy)
        self.problem = problem
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.problem}\n  -> {self.remedy}"


class UsageError(Aug3dError):
    """The command or the configuration cannot be right whatever the photographs are (exit code 2)."""


class InputError(Aug3dError):
    """The photographs, or a file made from them, cannot be used."""


class StoreError(Aug3dError):
    """The store cannot be opened, read or written."""


class DiskFull(StoreError):
    """A disk has no room left for what is to be written; nothing that was finished is lost."""


class TooLarge(Aug3dError):
    """The work needs more memory than this machine allows it."""


class StageFailed(Aug3dError):
    """A stage ended without an output.

    `cause` is one of refused (the input cannot be used), error, crash, killed, timeout, memory, disk; `log_tail` holds
    its last log lines and `replay` the command that repeats exactly this stage.
    """

    def __init__(self, stage: str, cause: str, problem: str, remedy: str, log_tail: str, replay: str) -> None:
        super().__init__(f"stage {stage} failed ({cause}): {problem}", remedy)
        self.stage = stage
        self.cause = cause
        self.log_tail = log_tail
        self.replay = replay
