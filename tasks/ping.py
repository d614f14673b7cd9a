"""Whether a server or database answers at all: asked before clients that would try again for minutes."""

from __future__ import annotations

import socket
import sqlite3
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

_PATIENCE_S = 5.0
_PORTS = {"http": 80, "https": 443, "postgresql": 5432, "mysql": 3306}


def unreachable(address: str) -> str | None:
    """Return why nothing answers at a URL; None if something does, or if there is no way to tell."""
    parts = urlsplit(address)
    scheme = parts.scheme.partition("+")[0]  # postgresql+psycopg2
    try:
        if scheme in _PORTS:
            socket.create_connection((parts.hostname or "", parts.port or _PORTS[scheme]), timeout=_PATIENCE_S).close()
        elif scheme == "sqlite" and (file := Path(address.removeprefix("sqlite:///"))).exists():
            with closing(sqlite3.connect(file, timeout=_PATIENCE_S)) as database:
                database.execute("SELECT name FROM sqlite_master LIMIT 1")
    except (OSError, ValueError, sqlite3.Error) as error:
        return str(error)
    return None
