"""Settings of Prefect and MLflow for a run on one machine, set before either is imported. What the user set wins."""

from __future__ import annotations

import os
from pathlib import Path

HOME_VARIABLE = "AUG3D_HOME"
OURS = "aug3d"  # tag of everything that aug3d registers and runs with a Prefect server, which others may use too
SCENE, COLLECTION = "scene", "collection"  # tags of what the registry holds
_THIS_MACHINE = ("127.0.0.1", "localhost", "::1")


def home() -> Path:
    """Return the folder for everything that aug3d makes, in a process that was started with it."""
    return Path(os.environ[HOME_VARIABLE])


def local_environment(home: Path) -> dict[str, str]:
    """Return the environment that keeps every database, result and artifact under `home` and sends nothing out."""
    return {
        "PREFECT_HOME": str(home / "prefect"),
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_LOGGING_LEVEL": "CRITICAL",  # the command line tells what happens; each stage has its own log
        "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_CLIENT_METRICS_ENABLED": "false",
        "PREFECT_CLIENT_MAX_RETRIES": "8",  # waits of 2, 4, ... s: a run outlives a server that is away for minutes
        "DO_NOT_TRACK": "1",
        "MLFLOW_DISABLE_TELEMETRY": "true",
        "MLFLOW_LOGGING_LEVEL": "ERROR",
        "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",  # it is for --json
        # What a server does not take within half a minute is told later; MLflow itself would try for twenty.
        "MLFLOW_HTTP_REQUEST_TIMEOUT": "15",
        "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    }


def apply_local_environment(home: Path) -> None:
    """Set what the user has not set."""
    for name, value in local_environment(home).items():
        os.environ.setdefault(name, value)


def reach_this_machine_directly() -> None:
    """Except this machine's own servers from the proxy that the environment names for what is outside, if any."""
    if not {name.lower() for name, value in os.environ.items() if value} & {"http_proxy", "https_proxy", "all_proxy"}:
        return
    # Python reads the small name where both are there
    excepted = os.environ.get("no_proxy") or os.environ.get("NO_PROXY") or ""
    every = dict.fromkeys((*filter(None, (part.strip() for part in excepted.split(","))), *_THIS_MACHINE))
    os.environ["no_proxy"] = os.environ["NO_PROXY"] = ",".join(every)
