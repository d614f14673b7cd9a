"""The way in to MLflow: the user's server, or a database in the store."""

from __future__ import annotations

import logging
from pathlib import Path

from mlflow.tracking import MlflowClient

from aug3d_core.store.scenes import mlflow_address
from aug3d_core.store.store import Store
from tasks.fresh_database import keep, lay_out
from tasks.ping import unreachable

_FILE, _MLFLOW = "sqlite:///", "mlflow"
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
    return client
