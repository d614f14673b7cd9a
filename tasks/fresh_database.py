"""Empty databases of Prefect and MLflow, kept in the user's cache: each makes its own by migrations that take seconds.

One is kept for each library and version, emptied from the first that the library made.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing, suppress
from importlib.metadata import version
from pathlib import Path

_REVISION = "alembic_version"
_SEEDS = {"prefect": {_REVISION}, "mlflow": {_REVISION, "workspaces"}}  # the tables that have rows in a new database
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
