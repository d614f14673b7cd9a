"""A real PostgreSQL of the test's own: Debian's package, started as a user without rights, killed as hard as a test likes."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import psutil
import psycopg2
import pytest

_PATIENCE_S = 60.0


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def programs() -> Path:
    """Return the folder of PostgreSQL's programs, or skip the test."""
    found = [Path(path).parent for path in [shutil.which("initdb")] if path]
    found += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)  # Debian keeps them off the PATH
    if not found:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    return found[0]


class Postgres:
    """One server with its databases."""

    def __init__(self, folder: Path, *databases: str) -> None:
        self._programs, self._folder, self.port = programs(), folder, free_port()
        self._as = _user()
        if self._as:
            shutil.chown(folder, **self._as)
        options = ["--pgdata", folder / "data", "--username", "aug3d", "--auth", "trust", "--no-sync"]
        make = [self._programs / "initdb", *options]
        subprocess.run(make, check=True, stdout=subprocess.DEVNULL, cwd=folder, **self._as)
        self.start()
        for database in databases:
            self._ask(f"CREATE DATABASE {database}")

    def start(self) -> None:
        """Start it and wait until it takes connections; begins anew while children of a killed one are still there."""
        deadline = time.monotonic() + _PATIENCE_S
        self._process = self._popen()
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                self._process = self._popen()
            with suppress(psycopg2.OperationalError):
                self._ask("SELECT 1")
                return
            time.sleep(0.2)
        pytest.fail("PostgreSQL did not start")

    def kill(self) -> None:
        """Pull the plug: SIGKILL for the server and all of its processes."""
        for process in (psutil.Process(self._process.pid), *psutil.Process(self._process.pid).children()):
            process.send_signal(signal.SIGKILL)
        self._process.wait()

    def _popen(self) -> subprocess.Popen:
        options = ["-D", self._folder / "data", "-p", str(self.port), "-h", "127.0.0.1", "-k", self._folder]
        with (self._folder / "log").open("ab") as log:
            return subprocess.Popen([self._programs / "postgres", *options], stdout=log, stderr=log, **self._as)

    def _ask(self, statement: str) -> None:
        where = {"host": "127.0.0.1", "port": self.port, "user": "aug3d", "dbname": "postgres"}
        with closing(psycopg2.connect(**where)) as connection:
            connection.autocommit = True
            connection.cursor().execute(statement)


def _user() -> dict[str, Any]:
    """Return whom to be: PostgreSQL refuses to run as root."""
    if os.geteuid():
        return {}
    known = {entry.pw_name for entry in pwd.getpwall()}
    user = pwd.getpwnam("postgres" if "postgres" in known else "nobody")
    return {"user": user.pw_uid, "group": user.pw_gid}
