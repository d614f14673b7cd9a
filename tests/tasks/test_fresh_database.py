"""A new home gets the tables that the library itself would make, and nothing of another home."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from tasks.fresh_database import is_current, keep, lay_out

LIBRARIES = ("prefect", "mlflow")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "aug3d"


def made(file: Path, row: str = "secret", revision: str = "r1") -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(file)) as opened, opened:
        opened.execute("PRAGMA journal_mode = WAL")
        opened.execute("CREATE TABLE alembic_version (version_num TEXT)")
        opened.execute("CREATE TABLE runs (name TEXT)")
        opened.execute("INSERT INTO alembic_version VALUES (?)", (revision,))
        opened.execute("INSERT INTO runs VALUES (?)", (row,))
    return file


def dump(file: Path) -> list[str]:
    with closing(sqlite3.connect(file)) as opened:
        return sorted(opened.iterdump())


def by_the_library(library: str, file: Path) -> Path:
    """Make a database by the library's own command."""
    command, address = {
        "prefect": (["prefect", "server", "database", "upgrade", "-y"], f"sqlite+aiosqlite:///{file}"),
        "mlflow": (["mlflow", "db", "upgrade", f"sqlite:///{file}"], ""),
    }[library]
    own = {"PREFECT_HOME": str(file.parent), "PREFECT_API_DATABASE_CONNECTION_URL": address}
    subprocess.run([sys.executable, "-m", *command], env={**os.environ, **own}, check=True, capture_output=True)
    return file


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_new_home_gets_what_the_library_makes_and_nothing_else(library: str, tmp_path: Path) -> None:
    own, used, new = by_the_library(library, tmp_path / "own.db"), tmp_path / "used.db", tmp_path / "new.db"
    with closing(sqlite3.connect(own)) as source, closing(sqlite3.connect(used)) as target:
        source.backup(target)
    with closing(sqlite3.connect(used)) as opened, opened:
        [table] = {"prefect": ["configuration"], "mlflow": ["experiment_tags"]}[library]
        width = len(opened.execute(f"PRAGMA table_info({table})").fetchall())
        opened.execute(f"INSERT INTO {table} VALUES ({', '.join(['1'] * width)})")
    keep(library, used)
    lay_out(library, new)
    assert dump(new) == dump(own) != dump(used)
    assert is_current(library, new) and is_current(library, used)


def test_nothing_of_another_home_is_left_in_the_file(tmp_path: Path, cache: Path) -> None:
    keep("prefect", made(tmp_path / "home.db"))
    [kept] = cache.iterdir()
    assert b"secret" in (tmp_path / "home.db").read_bytes() and b"secret" not in kept.read_bytes()


def test_a_database_that_is_there_stays(tmp_path: Path) -> None:
    keep("prefect", made(tmp_path / "first.db"))
    mine = made(tmp_path / "mine.db", "mine")
    before = dump(mine)
    lay_out("prefect", mine)
    assert dump(mine) == before


def test_an_older_database_is_not_current(tmp_path: Path) -> None:
    older = made(tmp_path / "older.db", revision="r0")
    assert not is_current("prefect", older), "nothing is known of this version yet"
    keep("prefect", made(tmp_path / "new.db"))
    assert not is_current("prefect", older)
    assert not is_current("prefect", tmp_path / "none.db") and not (tmp_path / "none.db").exists()


def test_a_cache_that_cannot_be_used_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    keep("prefect", made(tmp_path / "home.db"))
    lay_out("prefect", tmp_path / "new.db")
    assert not (tmp_path / "new.db").exists() and not is_current("prefect", tmp_path / "home.db")


def test_a_torn_database_in_the_cache_is_no_obstacle(tmp_path: Path, cache: Path) -> None:
    keep("prefect", made(tmp_path / "home.db"))
    [kept] = cache.iterdir()
    kept.write_bytes(b"torn")
    lay_out("prefect", tmp_path / "new.db")
    assert not (tmp_path / "new.db").exists() and not is_current("prefect", tmp_path / "home.db")
    assert {file.name for file in tmp_path.iterdir()} == {"cache", "home.db"}
