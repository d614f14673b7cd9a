"""Tie a process's life to its parent's, so that killing the factory leaves no renderer or trainer behind."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

# Process that the factory starts: the number of the process that starts it. A replay from a shell goes without
SUPERVISED = "AUG3D_SUPERVISED"
_PR_SET_PDEATHSIG, _PR_SET_NAME, _PR_SET_CHILD_SUBREAPER = 1, 15, 36


def die_with_parent(by: signal.Signals = signal.SIGKILL, parent: int | None = None) -> None:
    """Have the kernel end this process when its parent ends, even by SIGKILL (Linux; elsewhere the group is killed).

    That outlives `exec`. parent: number of the process that began this one; as the environment tells without it.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, by)
    # Number 1 takes the children of a parent that ended before the line above; in a container it may be the parent itself
    if os.getppid() == 1 != (parent or int(os.environ[SUPERVISED])):
        os._exit(1)


def call_this_process(name: str) -> None:
    """Show a name in `top` and `ps -o comm`, where a forked process would have that of what it was forked from (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())


def adopt_orphans() -> None:
    """Become the parent of every descendant that loses its own, so that none of them can be lost (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
