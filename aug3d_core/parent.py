"""Tie a process's life to its parent's, so that killing the factory leaves no renderer or trainer behind."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

SUPERVISED = "AUG3D_SUPERVISED"  # set for processes that the factory starts; a replay from a shell goes without
_PR_SET_PDEATHSIG = 1


def die_with_parent() -> None:
    """Have the kernel kill this process when its parent ends, even by SIGKILL (Linux; elsewhere the group is killed)."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() == 1:  # the parent ended before the line above
        os._exit(1)
