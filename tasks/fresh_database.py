"""Empty databases of Prefect and MLflow, kept in the user's cache: each makes its own by migrations that take seconds.

One is kept for each library and version, emptied from the first that the library made. And databases that Prefect cannot use.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from filelock import FileLock

_REVISION = "alembic_version"
_SEEDS = {"prefect": {_REVISION}, "mlflow": {_REVISION, "workspaces"}}  # the tables that have rows in a new database
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_TROUBLE = (OSError, sqlite3.Error)  # a cache that cannot be used: the library then makes its own database


def lay_out(library: str, database: Path) -> None:
    """Put a library's empty database where there is no file, if one is kept."""
    with suppress(*_TROUBLE):
        if _kept(library).exists() and not database.exists():
            _copy(_kept(library), database, os.link, lambda _: None)


def keep(library: str, database: Path) -> None:
    """Keep an empty copy of a database that the installed version has made, unless one is kept."""
    with suppress(*_TROUBLE):
        if not _kept(library).exists():
            _copy(database, _kept(library), os.replace, lambda copy: _empty(copy, _SEEDS[library]))


def is_current(library: str, database: Path) -> bool:
    """Say whether a database has the tables of the installed version; False also where that is not known."""
    try:
        kept, own = _revision(_kept(library)), _revision(database)
    except _TROUBLE:
        return False
    return kept == own


def set_aside(database: Path) -> str:
    """Rename Prefect's database if it is damaged, or newer than the installed version; say so in a line, or return nothing.

    It holds the history of runs, not their results: a run begins with a new one. Nothing of the old one is deleted.
    """
    if not database.exists():
        return ""
    with FileLock(database.with_suffix(".lock")):  # two runs that begin at once
        why = _unusable(database)
        if not why:
            return ""
        kept = database.with_name(f"{database.name}.{why}-{datetime.now(UTC):%Y%m%dT%H%M%S%f}")
        for end in ("", "-wal", "-shm"):
            with suppress(FileNotFoundError):
                Path(f"{database}{end}").rename(f"{kept}{end}")
    than = " than the installed version" if why == "newer" else ""
    return f"Prefect's database is {why}{than}: it is set aside as {kept}, and a new one begins"


def _unusable(database: Path) -> str:
    """Return what is wrong with Prefect's database, if anything is; one that is busy is not looked at."""
    try:
        with closing(_opened(database)) as opened:
            if opened.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
                return "damaged"
            tables = {name for (name,) in opened.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
            if not tables:
                return ""  # Prefect lays out an empty one
            if _REVISION not in tables:
                return "damaged"
            revisions = [revision for (revision,) in opened.execute(f"SELECT version_num FROM {_REVISION}")]
    except sqlite3.Error as error:
        return "damaged" if getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGED else ""
    return "newer" if any(not _is_known(revision) for revision in revisions) else ""


def _is_known(revision: str) -> bool:
    """Say whether the installed Prefect has a migration with this number."""
    with suppress(*_TROUBLE):
        if _revision(_kept("prefect")) == revision:
            return True
    found = find_spec("prefect")
    folders = [Path(folder) for folder in (found.submodule_search_locations or [])] if found else []
    steps = [file for folder in folders for file in folder.glob("server/database/_migrations/versions/sqlite/*.py")]
    quoted = (f'"{revision}"', f"'{revision}'")
    return not steps or any(number in file.read_text() for file in steps for number in quoted)


def _kept(library: str) -> Path:
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "aug3d" / f"{library}-{version(library)}.db"


def _copy(source: Path, target: Path, put: Callable[[Path, Path], None], change: Callable[[Path], None]) -> None:
    """Copy a database to a name that is never seen half written; with `os.link` the first of two copies stays."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        copy = Path(folder) / target.name
        with closing(_opened(source)) as old, closing(sqlite3.connect(copy)) as new:
            old.backup(new)
        change(copy)
        put(copy, target)


def _empty(database: Path, seeds: set[str]) -> None:
    with closing(sqlite3.connect(database, isolation_level=None)) as opened:
        for (table,) in opened.execute("SELECT name FROM sqlite_schema WHERE type = 'table'").fetchall():
            if table not in seeds:
                opened.execute(f'DELETE FROM "{table}"')
        opened.execute("VACUUM")  # what was deleted is gone from the file too


def _revision(database: Path) -> str:
    with closing(_opened(database)) as opened:
        return opened.execute(f"SELECT version_num FROM {_REVISION}").fetchone()[0]


def _opened(database: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{database.absolute().as_uri()}?mode=rw", uri=True)  # one that is there
