"""Whether a server or database answers, told at once."""

from __future__ import annotations

import socket
import sqlite3
import time
from pathlib import Path

import pytest

from tasks.ping import unreachable


def test_a_server_that_listens_is_reached_and_one_that_does_not_is_not() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        port = server.getsockname()[1]
        assert "refused" in (unreachable(f"http://127.0.0.1:{port}/api") or "")
        assert "refused" in (unreachable(f"postgresql+psycopg2://u:p@127.0.0.1:{port}/db") or "")
        server.listen()
        assert unreachable(f"http://127.0.0.1:{port}/api") is None


@pytest.mark.parametrize("address", ["http://127.0.0.1:99999", "http://no.such.host.invalid", "http://"])
def test_an_address_that_names_no_server(address: str) -> None:
    assert unreachable(address)


def test_a_database_is_looked_into(tmp_path: Path) -> None:
    file = tmp_path / "mlflow.db"
    address, started = f"sqlite:///{file}", time.monotonic()
    assert unreachable(address) is None and not file.exists(), "MLflow makes it"
    sqlite3.connect(file).close()
    assert unreachable(address) is None
    file.write_text("this is not a database, but it is longer than a header")
    assert "not a database" in (unreachable(address) or "")
    assert "unable to open" in (unreachable(f"sqlite:///{tmp_path}") or "")
    assert time.monotonic() - started < 5


def test_what_cannot_be_told_is_left_to_the_client() -> None:
    assert unreachable("databricks") is None
