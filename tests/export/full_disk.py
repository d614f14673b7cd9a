"""A disk without room, in place of what writes."""

from __future__ import annotations

import errno
import os
from typing import NoReturn


def full_disk(*_: object, **__: object) -> NoReturn:
    """Raise what the system raises."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
