"""The server of a run is there when it is needed, keeps to this machine, and ends with the run."""

from __future__ import annotations

import base64
import json
import logging
import os
import sqlite3
import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest

from aug3d_core.run.errors import StoreError
from flows.server import prefect_server
from flows.settings import local_environment
from tests.tests_support import wait_until_dead, words_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def home(tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING"):  # of a server that other tests share
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    for name, value in local_environment(tmp_path / "home").items():
        monkeypatch.setenv(name, value)
    return tmp_path / "home"


def asked() -> int:
    """Ask the server for its flows, and return how many there are."""
    address, secret = os.environ["PREFECT_API_URL"] + "/flows/count", os.environ["PREFECT_API_AUTH_STRING"]
    user = base64.b64encode(secret.encode()).decode()
    headers = {"Content-Type": "application/json", "Authorization": f"Basic {user}"}
    with urllib.request.urlopen(urllib.request.Request(address, b"{}", headers)) as answer:
        return json.loads(answer.read())


def servers() -> set[psutil.Process]:
    """Return the servers that this process has started: other tests may share one."""
    return {child for child in psutil.Process().children() if "flows.web" in words_of(child)}


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
        assert not {"PREFECT_API_URL", "PREFECT_API_AUTH_STRING"} & set(os.environ)
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


def test_nobody_without_its_token_is_let_in(home: Path) -> None:
    before = servers()
    with prefect_server(home) as ready:
        ready()
        address = os.environ["PREFECT_API_URL"] + "/flows/count"
        for secret in ("", "Basic YWRtaW46", "Bearer " + "0" * 64):
            request = urllib.request.Request(
                address, b"{}", {"Content-Type": "application/json", "Authorization": secret}
            )
            with pytest.raises(urllib.error.HTTPError, match="401"):
                urllib.request.urlopen(request)
        [server] = servers() - before
        assert os.environ["PREFECT_API_AUTH_STRING"].partition(":")[2] not in " ".join(words_of(server))


def test_one_that_is_killed_is_started_again_and_no_request_is_refused(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = servers()
    with prefect_server(home) as ready:
        ready()
        [first] = servers() - before
        asked()
        first.kill()
        first.wait()
        assert asked() == 0, "a request that comes while it is away waits for the next one"
        assert not logging.getLogger("websockets.client").isEnabledFor(logging.ERROR), (
            "the run shows no traceback of it"
        )
        [second] = servers() - before
        assert second.pid != first.pid and listening_at() == {"127.0.0.1"}
    assert "started again" in capsys.readouterr().err
    assert servers() == before


def test_one_that_is_killed_before_it_is_ready_is_started_again(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = servers()
    with prefect_server(home) as ready:
        [first] = servers() - before
        first.kill()
        wait_until_dead(first.pid)
        assert ready() and asked() == 0
    assert capsys.readouterr().err.count("started again") == 1
    assert servers() == before


def test_one_that_cannot_be_started_again_ends_the_run_with_a_typed_error(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = servers()
    with pytest.raises(StoreError, match="did not start"), prefect_server(home) as ready:
        ready()
        monkeypatch.setattr(sys, "executable", "/bin/false")
        [first] = servers() - before
        first.kill()
        asked()


@pytest.mark.parametrize("harm", ["damaged", "newer"])
def test_a_database_that_cannot_be_used_is_set_aside(harm: str, home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    database = home / "prefect" / "prefect.db"
    database.parent.mkdir(parents=True)
    if harm == "damaged":
        database.write_bytes(b"no database, though as long as the header of one is: " * 100)
    else:
        with closing(sqlite3.connect(database)) as opened, opened:
            opened.execute("CREATE TABLE alembic_version (version_num TEXT)")
            opened.execute("INSERT INTO alembic_version VALUES ('ffffffffffff')")
    before = database.read_bytes()
    with prefect_server(home) as ready:
        ready()
        assert asked() == 0
    [kept] = database.parent.glob(f"prefect.db.{harm}-*")
    assert kept.read_bytes() == before
    told = capsys.readouterr().err
    assert harm in told and str(kept) in told and told.count("\n") == 1
