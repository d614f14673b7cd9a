"""How a machine is called among those that share the work, with its home: two homes on one machine are two."""

from __future__ import annotations

import socket
from hashlib import sha256
from pathlib import Path


def machine_name(home: Path) -> str:
    """Return host and home, which has been resolved: a worker's name begins so, and the queue of what it alone is to do.

    Homes of one name in two folders are told apart: a queue's name has no room for a path.
    """
    return f"{socket.gethostname()} {home.name} {sha256(str(home).encode()).hexdigest()[:4]}"
