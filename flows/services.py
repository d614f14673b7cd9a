"""The services behind the pages: Prefect's server, MLflow's server, the worker. Their commands, settings, signs of health.

`python -m flows.services NAME` becomes that service, `python -m flows.services check NAME` says by its exit code whether it
is healthy; `aug3d up` and docker-compose.yml both go that way. Passwords and addresses of databases go through the environment
alone: every user of a machine can read command lines.
"""

from __future__ import annotations

import os
import secrets
import signal
import socket
import sys
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import psutil
import typer

from aug3d_core.run.errors import UsageError
from aug3d_core.run.limits import limits_from
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.store import layout
from flows.refusal import typed_errors
from flows.settings import local_environment

PREFECT, MLFLOW, WORKER = "prefect", "mlflow", "worker"
USER = "admin"
PASSWORD = "AUG3D_PASSWORD"
_LEAST_CHARACTERS = 12  # MLflow takes no shorter one
_HOME, _HOST = "AUG3D_HOME", "AUG3D_HOST"
_PREFECT_PORT, _MLFLOW_PORT = "AUG3D_PREFECT_PORT", "AUG3D_MLFLOW_PORT"
_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # listening on all addresses -> where this machine reaches it
_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class Serving:
    """Where the services keep their things and listen, and the password they ask for, if any."""

    home: Path
    host: str = "127.0.0.1"
    prefect_port: int = 4200
    mlflow_port: int = 5000
    password: str = ""

    @property
    def prefect(self) -> str:
        """Address of Prefect's pages as this machine reaches them."""
        return f"http://{_reached(self.host)}:{self.prefect_port}"

    @property
    def mlflow(self) -> str:
        """Address of MLflow's pages as this machine reaches them."""
        return f"http://{_reached(self.host)}:{self.mlflow_port}"

    @property
    def folder(self) -> Path:
        """Where the services keep their logs and what only they need."""
        return self.home / layout.SERVICES

    def as_environment(self) -> dict[str, str]:
        """Return what `serving_from` reads."""
        ports = {_PREFECT_PORT: str(self.prefect_port), _MLFLOW_PORT: str(self.mlflow_port)}
        return {_HOME: str(self.home), _HOST: self.host, PASSWORD: self.password, **ports}


def serving_from(environment: Mapping[str, str]) -> Serving:
    """Read where and how to serve; raises UsageError if that is open to others without a password."""
    serving = Serving(
        home=Path(environment.get(_HOME, "aug3d_data")).resolve(),
        host=environment.get(_HOST, "127.0.0.1"),
        prefect_port=int(environment.get(_PREFECT_PORT, "4200")),
        mlflow_port=int(environment.get(_MLFLOW_PORT, "5000")),
        password=environment.get(PASSWORD, ""),
    )
    check_password(serving)
    return serving


def check_password(serving: Serving) -> None:
    """Raise UsageError if others than this machine's users could reach the pages without a password, or by a poor one."""
    if not serving.password:
        if serving.host not in _LOOPBACK:
            raise UsageError(
                f"--host {serving.host} opens the pages, and so this machine, to whoever can reach it",
                f"set {PASSWORD} in the environment ({_LEAST_CHARACTERS} characters or more), or leave --host out",
            )
    elif len(serving.password) < _LEAST_CHARACTERS:
        raise UsageError(
            f"{PASSWORD} is too short: {len(serving.password)} characters",
            f"take {_LEAST_CHARACTERS} or more, which MLflow asks for",
        )
    elif find_spec("flask_wtf") is None:
        raise UsageError("MLflow needs Flask-WTF to ask for a password", "pip install -e '.[server]'")


def command(name: str, serving: Serving) -> list[str]:
    """Return the arguments of Python that a service runs as."""
    if name == PREFECT:
        listen = ["--host", serving.host, "--port", str(serving.prefect_port)]
        return ["-m", "prefect", "server", "start", *listen]
    if name == MLFLOW:
        listen = ["--host", serving.host, "--port", str(serving.mlflow_port), "--workers", "1"]
        listen += ["--uvicorn-opts=--no-access-log"]  # a line for every click, for months
        return ["-m", "mlflow", "server", *listen, *(["--app-name", "basic-auth"] if serving.password else [])]
    return ["-m", "flows.worker"]


def healthy(name: str, serving: Serving) -> bool:
    """Ask whether a service can be used: a server answers, the worker has said so (`tell_ready`)."""
    if name == WORKER:
        return ready_file(serving.home).exists()
    address = f"{serving.prefect}/api/health" if name == PREFECT else f"{serving.mlflow}/health"
    try:
        with urllib.request.urlopen(address, timeout=5):
            return True
    except OSError:
        return False


def ready_file(home: Path) -> Path:
    """Return the file that is there once the worker takes runs."""
    return home / layout.SERVICES / layout.WORKER_READY


def settings(name: str, serving: Serving) -> dict[str, str]:
    """Return the environment of a service. What the user set is stronger than this."""
    own = {PREFECT: _prefect, MLFLOW: _mlflow, WORKER: clients}[name]
    # Nobody watches a terminal here: what happens is read in the pages and in the services' logs.
    told = {"PREFECT_LOGGING_LEVEL": "INFO", "PREFECT_SERVER_LOGGING_LEVEL": "WARNING"}
    return {**local_environment(serving.home), **told, _HOME: str(serving.home), **own(serving)}


def _prefect(serving: Serving) -> dict[str, str]:
    origins = [f"http://{name}:{serving.prefect_port}" for name in _names(serving.host)]
    return {
        # Which runs hold which limit is kept in memory otherwise: five minutes after a restart Prefect would end them all.
        "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
        "PREFECT_UI_API_URL": "/api",  # whatever address the pages were opened by
        "PREFECT_SERVER_CORS_ALLOWED_ORIGINS": ",".join(origins),  # Prefect lets every page of the web in
        **({"PREFECT_SERVER_API_AUTH_STRING": f"{USER}:{serving.password}"} if serving.password else {}),
    }


def _mlflow(serving: Serving) -> dict[str, str]:
    names = _names(serving.host)
    own = {
        "MLFLOW_BACKEND_STORE_URI": f"sqlite:///{serving.home / layout.MLFLOW_DATABASE}",
        "MLFLOW_SERVER_ALLOWED_HOSTS": ",".join([*names, *(f"{name}:{serving.mlflow_port}" for name in names)]),
        "MLFLOW_SERVER_CORS_ALLOWED_ORIGINS": ",".join(f"http://{name}:{serving.mlflow_port}" for name in names),
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",  # judges of language models: processes that nobody here needs
    }
    if "MLFLOW_ARTIFACTS_DESTINATION" not in os.environ:
        # Worker and server share a disk: files are written and read where `aug3d run` without a server puts them.
        own["MLFLOW_DEFAULT_ARTIFACT_ROOT"] = (serving.home / layout.MLFLOW_ARTIFACTS).as_uri()
        own["MLFLOW_SERVE_ARTIFACTS"] = "false"
    if serving.password:
        own["MLFLOW_AUTH_CONFIG_PATH"] = str(serving.folder / layout.MLFLOW_AUTH_CONFIG)
        own["MLFLOW_AUTH_ADMIN_USERNAME"], own["MLFLOW_AUTH_ADMIN_PASSWORD"] = USER, serving.password
        own["MLFLOW_FLASK_SERVER_SECRET_KEY"] = secrets.token_hex()
    return own


def clients(serving: Serving) -> dict[str, str]:
    """Return the environment by which clients find both servers and give the password."""
    servers = {"PREFECT_API_URL": f"{serving.prefect}/api", "MLFLOW_TRACKING_URI": serving.mlflow}
    if not serving.password:
        return servers
    mlflow = {"MLFLOW_TRACKING_USERNAME": USER, "MLFLOW_TRACKING_PASSWORD": serving.password}
    return {**servers, "PREFECT_API_AUTH_STRING": f"{USER}:{serving.password}", **mlflow}


def tell_ready(home: Path) -> None:
    """Say, from the worker, that it has registered the scenes and takes runs."""
    ready_file(home).parent.mkdir(mode=0o700, exist_ok=True)
    ready_file(home).touch()


def _reached(host: str) -> str:
    host = _EVERYWHERE.get(host, host)
    return f"[{host}]" if ":" in host else host


def _names(host: str) -> list[str]:
    """Return every name by which a browser may have reached the pages; others are turned away (DNS rebinding)."""
    if host in _LOOPBACK:
        return ["127.0.0.1", "localhost", "[::1]"]
    if host not in _EVERYWHERE:
        return [_reached(host)]
    addresses = [address for found in psutil.net_if_addrs().values() for address in found]
    numbers = [a.address.partition("%")[0] for a in addresses if a.family in (socket.AF_INET, socket.AF_INET6)]
    return list(dict.fromkeys(["localhost", socket.gethostname(), socket.getfqdn(), *map(_reached, numbers)]))


def _prepare(name: str, serving: Serving) -> None:
    """Make the folder that only this user may read, and what a service finds there when it starts."""
    serving.folder.mkdir(parents=True, exist_ok=True)
    serving.folder.chmod(0o700)
    if name == WORKER:
        ready_file(serving.home).unlink(missing_ok=True)  # an earlier worker's
    if name == MLFLOW and serving.password:
        config, database = (serving.folder / file for file in (layout.MLFLOW_AUTH_CONFIG, layout.MLFLOW_AUTH_DATABASE))
        for file in (config, database):
            file.touch(mode=0o600)
        # Without the cache each request hashes the password anew: 0.8 s on a busy machine.
        lines = ["default_permission = READ", f"database_uri = sqlite:///{database}", "auth_cache_ttl_seconds = 60"]
        config.write_text("\n".join(["[mlflow]", *lines, ""]))


def service(words: Annotated[list[str], typer.Argument(metavar=f"[check] {PREFECT}|{MLFLOW}|{WORKER}")]) -> None:
    """Become the service that is named; or, after `check`, say by the exit code whether it is healthy."""
    with typed_errors(as_json=False):
        *check, name = words
        if name not in (PREFECT, MLFLOW, WORKER) or check not in ([], ["check"]):
            raise UsageError(f"there is no service {' '.join(words)!r}", f"one of {PREFECT}, {MLFLOW}, {WORKER}")
        serving = serving_from(os.environ)
        if check:
            raise typer.Exit(0 if healthy(name, serving) else 1)
        _become(name, serving)


def _become(name: str, serving: Serving) -> None:
    limits_from(os.environ)  # which the worker's stages have
    if SUPERVISED in os.environ:
        # End with `aug3d up`. MLflow passes SIGTERM on to the process that serves; SIGKILL would leave that behind.
        die_with_parent(signal.SIGTERM if name == MLFLOW else signal.SIGKILL)
    _prepare(name, serving)
    os.execve(sys.executable, [sys.executable, *command(name, serving)], {**settings(name, serving), **os.environ})


if __name__ == "__main__":
    typer.run(service)
