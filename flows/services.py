"""The services behind the pages: Prefect's server, MLflow's server, the worker. Their commands, settings, signs of health.

For containers there are a Dask scheduler and its worker too, at the address in AUG3D_DASK.

`python -m flows.services NAME` becomes that service, `python -m flows.services check NAME` says by its exit code whether it
is healthy; `aug3d up` and docker-compose.yml both go that way.
"""

from __future__ import annotations

import os
import sys
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from aug3d_core.factory.scheduler import DASK, scheduler_from, worker_count
from aug3d_core.run.errors import UsageError
from aug3d_core.run.limits import limits_from
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.store import layout
from flows.guard import USER
from flows.refusal import typed_errors
from flows.serving import (
    HELPER,
    MLFLOW,
    PREFECT,
    SCHEDULER,
    WORKER,
    Serving,
    queues_from,
    secrets_read,
    serving_from,
    with_secret,
)
from flows.settings import local_environment

# Nobody watches a terminal here: what happens is read in the pages and in the services' logs.
TOLD = {"PREFECT_LOGGING_LEVEL": "INFO", "PREFECT_SERVER_LOGGING_LEVEL": "WARNING"}
ASKING = {"PREFECT_WORKER_QUERY_SECONDS": "2"}  # how often a worker asks for runs
NAMES = (PREFECT, MLFLOW, WORKER, SCHEDULER, HELPER)


def command(name: str, dask: str = "") -> list[str]:
    """Return the arguments of Python that a service runs as. dask: the scheduler's address."""
    if name in (SCHEDULER, HELPER):
        return _of_dask(name, dask)
    return ["-m", "flows.worker"] if name == WORKER else ["-m", "flows.web", name]


def _of_dask(name: str, address: str) -> list[str]:
    protocol, place = address.split("://")
    host, _, port = place.rpartition(":")
    closed = ["--no-dashboard", "--protocol", protocol]  # Dask's pages ask for no password
    if name == SCHEDULER:
        return ["-m", "distributed.cli.dask_scheduler", *closed, "--host", host.strip("[]"), "--port", port]
    # What it makes, it makes in processes of their own, with their own limits
    one = ["--nworkers", "1", "--nthreads", "1", "--no-nanny", "--memory-limit", "0"]
    return ["-m", "distributed.cli.dask_worker", address, *closed, *one]


def healthy(name: str, serving: Serving, dask: str = "") -> bool:
    """Ask whether a service can be used: a server answers, the worker has said so (`tell_ready`), a helper is known to Dask."""
    if name in (SCHEDULER, HELPER):
        try:
            return worker_count(dask) >= (name == HELPER)
        except UsageError:
            return False
    if name == WORKER:
        return ready_file(serving.home).exists()
    try:
        with urllib.request.urlopen(serving.healthy_at(name), timeout=5):
            return True
    except OSError:
        return False


def ready_file(home: Path) -> Path:
    """Return the file that is there once the worker takes runs."""
    return home / layout.SERVICES / layout.WORKER_READY


def settings(name: str, serving: Serving) -> dict[str, str]:
    """Return the environment of a service. What the user set is stronger than this."""
    own = {PREFECT: _prefect, MLFLOW: _mlflow, WORKER: _worker, SCHEDULER: _dask, HELPER: _dask}[name]
    return {**local_environment(serving.home), **TOLD, **own(serving)}


def _prefect(serving: Serving) -> dict[str, str]:
    return {
        # Which runs hold which limit is kept in memory otherwise: five minutes after a restart Prefect would end them all.
        "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
        "PREFECT_UI_API_URL": "/api",  # whatever address the pages were opened by
        "PREFECT__SERVER_FINAL": "1",  # one app in this process
    }


def _mlflow(serving: Serving) -> dict[str, str]:
    own = {
        "MLFLOW_BACKEND_STORE_URI": f"sqlite:///{serving.home / layout.MLFLOW_DATABASE}",
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",  # judges of language models: processes that nobody here needs
    }
    if "MLFLOW_ARTIFACTS_DESTINATION" not in os.environ:
        # Worker and server share a disk: files are written and read where `aug3d run` without a server puts them.
        own["MLFLOW_DEFAULT_ARTIFACT_ROOT"] = (serving.home / layout.MLFLOW_ARTIFACTS).as_uri()
        own["MLFLOW_SERVE_ARTIFACTS"] = "false"
    return own


def _worker(serving: Serving) -> dict[str, str]:
    return {**clients(serving), **ASKING}


def _dask(serving: Serving) -> dict[str, str]:
    return {"DASK_TEMPORARY_DIRECTORY": str(serving.folder)}


def clients(serving: Serving) -> dict[str, str]:
    """Return the environment by which clients find both servers and give the secret."""
    servers = {"PREFECT_API_URL": f"{serving.prefect}/api", "MLFLOW_TRACKING_URI": serving.mlflow}
    mlflow = {"MLFLOW_TRACKING_USERNAME": USER, "MLFLOW_TRACKING_PASSWORD": serving.password}
    return {**servers, "PREFECT_API_AUTH_STRING": serving.user_and_password(), **mlflow}


def tell_ready(home: Path) -> None:
    """Say, from the worker, that it has registered the scenes and takes runs."""
    ready_file(home).parent.mkdir(mode=0o700, exist_ok=True)
    ready_file(home).touch()


def service(words: Annotated[list[str], typer.Argument(metavar=f"[check] {'|'.join(NAMES)}")]) -> None:
    """Become the service that is named; or, after `check`, say by the exit code whether it is healthy."""
    with typed_errors(as_json=False):
        *check, name = words
        if name not in NAMES or check not in ([], ["check"]):
            raise UsageError(f"there is no service {' '.join(words)!r}", f"one of {', '.join(NAMES)}")
        os.environ.update(secrets_read(os.environ))
        serving, dask = serving_from(os.environ), _scheduler(name, os.environ)
        if check:
            raise typer.Exit(0 if healthy(name, serving, dask) else 1)
        _become(name, serving, dask)


def _scheduler(name: str, environment: Mapping[str, str]) -> str:
    address = scheduler_from(environment)
    if not address and name in (SCHEDULER, HELPER):
        raise UsageError(f"{DASK} is not set", f"set it to the address that {name} has, e.g. tcp://127.0.0.1:8786")
    return address


def _become(name: str, serving: Serving, dask: str = "") -> None:
    limits_from(os.environ)  # which the worker's stages have
    queues_from(os.environ)
    if SUPERVISED in os.environ:
        die_with_parent()
    serving = with_secret(serving)
    if name == WORKER:
        ready_file(serving.home).unlink(missing_ok=True)  # an earlier worker's
    if name == MLFLOW:
        from tasks.mlflow_client import follow_home  # with all of MLflow, which other services do without

        follow_home(serving.home)
    environment = {**settings(name, serving), **os.environ, **serving.as_environment()}
    os.execve(sys.executable, [sys.executable, *command(name, dask)], environment)


if __name__ == "__main__":
    typer.run(service)
