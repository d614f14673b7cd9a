"""Tie a process's life to its parent's, so that killing the factory leaves no renderer or trainer behind."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

SUPERVISED = "AUG3D_SUPERVISED"  # set for processes that the factory starts; a replay from a shell goes without
_PR_SET_PDEATHSIG, _PR_SET_NAME, _PR_SET_CHILD_SUBREAPER = 1, 15, 36


def die_with_parent(by: signal.Signals = signal.SIGKILL) -> None:
    """Have the kernel end this process when its parent ends, even by SIGKILL (Linux; elsewhere the group is killed).

    That outlives `exec`.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, by)
    if os.getppid() == 1:  # the parent ended before the line above
        os._exit(1)


def call_this_process(name: str) -> None:
    """Show a name in `top` and `ps -o comm`, where a forked process would have that of what it was forked from (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())


def adopt_orphans() -> None:
    """Become the parent of every descendant that loses its own, so that none of them can be lost (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
