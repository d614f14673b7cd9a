"""MLflow's pages as an ASGI app, made as `mlflow server` makes them: that command starts other processes, which outlive it."""

from __future__ import annotations

import os
import uuid

from starlette.types import ASGIApp


def mlflow_app() -> ASGIApp:
    """Return the app, its database brought up to date, by the variables that `mlflow server` reads."""
    # Hosts and origins are looked at before anything reaches the app (flows/guard.py). It reads this when it is imported.
    os.environ["MLFLOW_SERVER_DISABLE_SECURITY_MIDDLEWARE"] = "true"
    os.environ["_MLFLOW_SERVER_BOOT_ID"] = uuid.uuid4().hex

    from mlflow.server import constants
    from mlflow.server.handlers import initialize_backend_stores
    from mlflow.utils.server_cli_utils import resolve_default_artifact_root

    database = os.environ["MLFLOW_BACKEND_STORE_URI"]
    serves = os.environ.get("MLFLOW_SERVE_ARTIFACTS", "true").lower() not in ("false", "0")
    root = resolve_default_artifact_root(serves, os.environ.get("MLFLOW_DEFAULT_ARTIFACT_ROOT", ""), database)
    told = {
        constants.BACKEND_STORE_URI_ENV_VAR: database,
        constants.REGISTRY_STORE_URI_ENV_VAR: database,
        constants.ARTIFACT_ROOT_ENV_VAR: root,
        constants.SERVE_ARTIFACTS_ENV_VAR: "true" if serves else "",
        constants.ARTIFACTS_DESTINATION_ENV_VAR: os.environ.get("MLFLOW_ARTIFACTS_DESTINATION", "./mlartifacts"),
    }
    os.environ.update({name: value for name, value in told.items() if value})
    initialize_backend_stores(database, database, root)

    from mlflow.server.fastapi_app import app

    return app
