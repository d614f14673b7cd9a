"""The way in to MLflow: the user's server, or a database in the store."""

from __future__ import annotations

import logging
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

from mlflow.tracking import MlflowClient

from aug3d_core.store import layout
from aug3d_core.store.scenes import mlflow_address
from aug3d_core.store.store import Store
from tasks.fresh_database import keep, lay_out
from tasks.ping import unreachable

_FILE, _MLFLOW = "sqlite:///", "mlflow"
# Where its database holds whole addresses of files
_ADDRESSES = (
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("logged_models", "artifact_location"),
    ("model_versions", "source"),
    ("model_versions", "storage_location"),
)
# It prints the traceback of what it raises as well, such as a full disk, which a run tells in a line
logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)


def mlflow_client(store: Store) -> MlflowClient:
    """Return a client; raises ConnectionError if nothing answers, and what MLflow raises."""
    address = mlflow_address(store)
    if why := unreachable(address):
        raise ConnectionError(why)
    database = Path(address.removeprefix(_FILE)) if address.startswith(_FILE) else None
    if database is not None:
        lay_out(_MLFLOW, database)
    client = MlflowClient(address)
    if database is not None:
        keep(_MLFLOW, database)
        follow_home(store.root)
    return client


def follow_home(home: Path) -> None:
    """Let the database of a home that was moved name its files where they are now, not where they were.

    MLflow has no call for that. What is wrong with the database it says itself.
    """
    there = (home / layout.MLFLOW_DATABASE).absolute().as_uri()
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"{there}?mode=rw", uri=True)) as opened, opened:
        for name, was in opened.execute("SELECT name, artifact_location FROM experiments").fetchall():
            now = (home / layout.MLFLOW_ARTIFACTS / name).absolute().as_uri()
            if was != now and was.endswith(now.removeprefix(home.absolute().as_uri())):
                moved = (now, len(was) + 1, was, len(was) + 1, f"{was}/")
                for table, column in _ADDRESSES:
                    changed = f"UPDATE {table} SET {column} = ? || substr({column}, ?)"
                    opened.execute(f"{changed} WHERE {column} = ? OR substr({column}, 1, ?) = ?", moved)
