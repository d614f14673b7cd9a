"""A Prefect server that lives exactly as long as one run, behind a guard and with a secret of that run.

Prefect can start such a server by itself, but that one outlives a run that is killed, and the next one beside it.
"""

from __future__ import annotations

import logging
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from aug3d_core.run.errors import Aug3dError, StoreError
from aug3d_core.run.linux_process import SUPERVISED
from aug3d_core.run.process import log_tail
from aug3d_core.store import layout
from flows.serving import LISTENING, PREFECT, Serving
from tasks.fresh_database import is_current, keep, lay_out, set_aside

_PATIENCE_S = 180.0  # a busy machine needs far longer than an idle one's 3 s
_MOST_STARTS = 10
_API, _AUTH, _RETRIES = "PREFECT_API_URL", "PREFECT_API_AUTH_STRING", "PREFECT_CLIENT_MAX_RETRIES"
_ADDRESSES = ("PREFECT_API_DATABASE_CONNECTION_URL", "PREFECT_SERVER_DATABASE_CONNECTION_URL")  # old name and new


@contextmanager
def prefect_server(home: Path) -> Iterator[Callable[[], bool]]:
    """Start a server on loopback and point Prefect to it, unless the user named one.

    Yields the function that waits until it can be used, and raises StoreError if that never is: there is time to work
    before it is called. It returns whether the server is this run's own. One that dies is started again; a run that fails
    since that did not help raises StoreError.
    """
    # Of a connection that a killed server leaves it prints a traceback; Prefect connects again, or tells the run.
    logging.getLogger("websockets.client").setLevel(logging.CRITICAL)
    if os.environ.get(_API):
        yield lambda: False
        return
    server = _Server(home)
    # A server that is away is waited for by the socket; one that cannot be started again shall not be waited for.
    own = {_API: f"{server.serving.prefect}/api", _AUTH: server.serving.user_and_password(), _RETRIES: "3"}
    before = {name: os.environ.get(name) for name in own}
    try:
        os.environ.update(own)
        server.start()
        yield server.wait
    except Aug3dError:
        raise
    except Exception as error:
        if server.lost:
            raise server.lost from error
        raise
    finally:
        server.end()
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


class _Server:
    """The process, and the socket that it listens on.

    The socket is this process's: while a server that was killed is started again, requests wait in it and are not refused.
    """

    lost: StoreError | None = None  # why it could not be started again

    def __init__(self, home: Path) -> None:
        self._socket = socket.create_server(("127.0.0.1", 0), backlog=1024)
        self.serving = Serving(home, prefect_port=self._socket.getsockname()[1], password=secrets.token_hex())
        self._log = home / layout.PREFECT / "server.log"
        self._log.parent.mkdir(parents=True, exist_ok=True)
        self._log.unlink(missing_ok=True)  # an earlier run's
        self._database = own_database(home)
        self._starts = 0
        self._ending = False
        self._turn = threading.Lock()

    def start(self) -> None:
        """Start it, unless the run ends."""
        with self._turn:
            if self._ending:
                return
            # What Prefect itself sets for a server of this kind; the pages would only cost time here.
            settings = {"PREFECT_UI_ENABLED": "0", "PREFECT__SERVER_EPHEMERAL": "1", "PREFECT__SERVER_FINAL": "1"}
            number = self._socket.fileno()
            told = {
                **self.serving.as_environment(),
                SUPERVISED: str(os.getpid()),
                LISTENING: str(number),
                "PYTHONUNBUFFERED": "1",
            }
            with self._log.open("ab") as file:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "flows.web", PREFECT],
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=file,
                    start_new_session=True,  # Ctrl-C reaches the run first, which then ends the server
                    pass_fds=(number,),
                    env={**os.environ, **settings, **_start_with(self._database), **told},
                )
            self._starts += 1

    def wait(self) -> bool:
        """Wait until it can be used; from then on it is started again whenever it dies, until then if it is killed."""
        self._wait_until_healthy()
        if self._database is not None:
            keep(layout.PREFECT, self._database)
        threading.Thread(target=self._keep_up, daemon=True).start()
        return True

    def end(self) -> None:
        """Kill it: its database is a journal, nothing is lost, and waiting for its good-bye takes seconds."""
        with self._turn:
            self._ending = True
            if self._starts:
                self._process.kill()
                self._process.wait()
            self._socket.close()

    def _keep_up(self) -> None:
        while True:
            self._process.wait()
            if self._ending:
                return
            try:
                self._start_again()
                self._wait_until_healthy()
            except Exception as error:  # whatever it is, the run must hear of it
                self.lost = error if isinstance(error, StoreError) else StoreError(str(error), f"look at {self._log}")
                self._socket.close()  # who waits in it is refused now
                return

    def _start_again(self) -> None:
        if self._starts >= _MOST_STARTS:
            raise StoreError(f"Prefect's server of this run ended {self._starts} times", f"look at {self._log}")
        code = self._process.returncode
        print(f"Prefect's server of this run ended ({code}); it is started again", file=sys.stderr, flush=True)
        self.start()

    def _wait_until_healthy(self) -> None:
        deadline = time.monotonic() + _PATIENCE_S
        address = self.serving.healthy_at(PREFECT)
        while time.monotonic() < deadline and not self._ending:
            if (code := self._process.poll()) == -signal.SIGKILL:  # it comes from outside: another start may go well
                self._start_again()
            elif code is not None:
                break
            try:
                with urllib.request.urlopen(address, timeout=1):
                    return
            except OSError:
                time.sleep(0.05)
        if not self._ending:
            raise StoreError(
                f"Prefect's server did not start on port {self.serving.prefect_port}; it last said:\n{log_tail(self._log)}",
                f"look at {self._log}, or start one with `prefect server start` and set {_API}",
            )


def own_database(home: Path) -> Path | None:
    """Return the file of the server's database; None if the user named another database."""
    if any(map(os.environ.get, _ADDRESSES)):
        return None
    return Path(os.environ.get("PREFECT_HOME") or home / layout.PREFECT) / "prefect.db"


def _start_with(database: Path | None) -> dict[str, str]:
    """Return settings that spare the server seconds of migrations if its database is as this version makes it."""
    if database is None:
        return {}
    if told := set_aside(database):
        print(told, file=sys.stderr, flush=True)
    lay_out(layout.PREFECT, database)
    look = str(not is_current(layout.PREFECT, database))
    # Blocks are forms of the pages. `aug3d up` adds them, unless it finds a note (memo) that they were added.
    blocks = {"PREFECT_API_BLOCKS_REGISTER_ON_START": look, "PREFECT_MEMOIZE_BLOCK_AUTO_REGISTRATION": look}
    return {"PREFECT_API_DATABASE_MIGRATE_ON_START": look, **blocks}
