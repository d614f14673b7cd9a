"""The server of a run is there when it is needed, keeps to this machine, and ends with the run."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import urllib.request
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest

from aug3d_core.run.errors import StoreError
from flows.server import prefect_server
from flows.settings import local_environment
from tests.tests_support import words_of

pytestmark = pytest.mark.slow


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name, value in local_environment(tmp_path / "home").items():
        monkeypatch.setenv(name, value)
    return tmp_path / "home"


def asked() -> int:
    """Ask the server for its flows, and return how many there are."""
    address, headers = os.environ["PREFECT_API_URL"] + "/flows/count", {"Content-Type": "application/json"}
    with urllib.request.urlopen(urllib.request.Request(address, b"{}", headers)) as answer:
        return json.loads(answer.read())


def servers() -> set[psutil.Process]:
    """Return the servers that this process has started: other tests may share one."""
    return {child for child in psutil.Process().children() if "flows.server" in words_of(child)}


def listening_at() -> set[str]:
    port = urlsplit(os.environ["PREFECT_API_URL"]).port
    found = psutil.net_connections("tcp")
    return {c.laddr.ip for c in found if c.laddr and c.laddr.port == port and c.status == psutil.CONN_LISTEN}  # pyright: ignore[reportAttributeAccessIssue]


def test_it_serves_a_new_home_a_second_one_and_one_that_is_known(home: Path, tmp_path: Path) -> None:
    revisions, before = set(), servers()
    for again in (home, tmp_path / "second", home):
        os.environ["PREFECT_HOME"] = str(again / "prefect")
        with prefect_server(again) as ready:
            assert ready(), "it is the run's own"
            assert asked() == 0 and listening_at() == {"127.0.0.1"}
        assert "PREFECT_API_URL" not in os.environ
        with closing(sqlite3.connect(again / "prefect" / "prefect.db")) as opened:
            revisions.add(opened.execute("SELECT version_num FROM alembic_version").fetchone())
        assert again == home or not (again / "prefect" / "memo_store.toml").exists(), (
            "what `aug3d up` adds is still to come"
        )
    assert len(revisions) == 1
    assert servers() == before


def test_an_older_database_is_brought_up_to_date(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = home / "prefect" / "prefect.db"
    database.parent.mkdir(parents=True)
    address = {"PREFECT_API_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{database}"}
    older = ["-m", "prefect", "server", "database", "upgrade", "-y"]
    subprocess.run([sys.executable, *older], env={**os.environ, **address}, check=True, capture_output=True)
    with prefect_server(home) as ready:  # the tables of this version are known from here on
        ready()
    back = ["-m", "prefect", "server", "database", "downgrade", "-y", "-r", "-1"]
    subprocess.run([sys.executable, *back], env={**os.environ, **address}, check=True, capture_output=True)
    with prefect_server(home) as ready:
        ready()
        assert asked() == 0


def test_one_that_does_not_start_is_told_with_its_words(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT_API_DATABASE_CONNECTION_URL", f"sqlite+aiosqlite:///{home}")  # a folder
    with pytest.raises(StoreError, match="did not start"), prefect_server(home) as ready:
        ready()


def test_a_server_that_the_user_named_is_left_alone(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:1/api")
    with prefect_server(home) as ready:
        assert not ready()
    assert os.environ["PREFECT_API_URL"] == "http://127.0.0.1:1/api" and not home.exists()
