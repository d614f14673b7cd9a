"""A Prefect server that lives exactly as long as one run: `python -m flows.server PORT` is its process.

Prefect can start such a server by itself, but that one outlives a run that is killed, and the next one beside it.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from aug3d_core.run.errors import StoreError
from aug3d_core.run.linux_process import die_with_parent
from aug3d_core.run.process import log_tail
from aug3d_core.run.short_process import collect_seldom
from aug3d_core.store import layout
from tasks.fresh_database import is_current, keep, lay_out

_PATIENCE_S = 180.0  # a busy machine needs far longer than an idle one's 3 s
_API = "PREFECT_API_URL"
_ADDRESSES = ("PREFECT_API_DATABASE_CONNECTION_URL", "PREFECT_SERVER_DATABASE_CONNECTION_URL")  # old name and new


@contextmanager
def prefect_server(home: Path) -> Iterator[Callable[[], bool]]:
    """Start a server on loopback and point Prefect to it, unless the user named one.

    Yields the function that waits until it can be used, and raises StoreError if that never is: there is time to work
    before it is called. It returns whether the server is this run's own.
    """
    if os.environ.get(_API):
        yield lambda: False
        return
    port = _free_port()
    log = home / layout.PREFECT / "server.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    database = _database()
    with log.open("wb") as file:
        # What Prefect itself sets for a server of this kind; the pages would only cost time here.
        settings = {"PREFECT_UI_ENABLED": "0", "PREFECT__SERVER_EPHEMERAL": "1", "PREFECT__SERVER_FINAL": "1"}
        settings |= _start_with(database)
        server = subprocess.Popen(
            [sys.executable, "-m", "flows.server", str(port)],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
            start_new_session=True,  # Ctrl-C reaches the run first, which then ends the server
            env={**os.environ, **settings},
        )

    def wait() -> bool:
        _wait_until_healthy(server, port, log)
        if database is not None:
            keep(layout.PREFECT, database)
        return True

    try:
        os.environ[_API] = f"http://127.0.0.1:{port}/api"
        yield wait
    finally:
        os.environ.pop(_API, None)
        server.kill()  # its database is a journal: nothing is lost, and waiting for its good-bye takes seconds
        server.wait()


def _wait_until_healthy(server: subprocess.Popen, port: int, log: Path) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while server.poll() is None and time.monotonic() < deadline:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/health", timeout=5):
                return
        except OSError:
            time.sleep(0.1)
    raise StoreError(
        f"Prefect's server did not start on port {port}; it last said:\n{log_tail(log)}",
        f"look at {log}, or start one with `prefect server start` and set {_API}",
    )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _database() -> Path | None:
    """Return the file of the server's database; None if the user named another database."""
    return None if any(map(os.environ.get, _ADDRESSES)) else Path(os.environ["PREFECT_HOME"]) / "prefect.db"


def _start_with(database: Path | None) -> dict[str, str]:
    """Return settings that spare the server seconds of migrations if its database is as this version makes it."""
    if database is None:
        return {}
    lay_out(layout.PREFECT, database)
    look = str(not is_current(layout.PREFECT, database))
    # Blocks are forms of the pages. `aug3d up` adds them, unless it finds a note (memo) that they were added.
    blocks = {"PREFECT_API_BLOCKS_REGISTER_ON_START": look, "PREFECT_MEMOIZE_BLOCK_AUTO_REGISTRATION": look}
    return {"PREFECT_API_DATABASE_MIGRATE_ON_START": look, **blocks}


def main() -> None:
    """Serve until killed, or until the run that started this process ends."""
    die_with_parent()
    collect_seldom()
    import uvicorn

    uvicorn.run(
        "prefect.server.api.server:create_app",
        factory=True,
        host="127.0.0.1",
        port=int(sys.argv[1]),
        log_level="error",
        lifespan="on",
    )


if __name__ == "__main__":
    main()
