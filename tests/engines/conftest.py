"""Engines under test share the machine with other work, as stages do in `isolation.py`."""

import os

from aug3d_core.isolation import QUIET_THREADS

for name, value in QUIET_THREADS.items():
    os.environ.setdefault(name, value)  # before torch loads OpenMP
