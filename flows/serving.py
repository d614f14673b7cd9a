"""Where the services are and what they ask for: read from the environment, which alone carries the secret.

Every user of a machine can read command lines.
"""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from flows.guard import TOKEN, USER, Door
from flows.options import DEFAULT_HOME
from flows.settings import HOME_VARIABLE

PREFECT, MLFLOW, WORKER = "prefect", "mlflow", "worker"
SCHEDULER, HELPER = "dask-scheduler", "dask-worker"
CPU, GPU = "cpu", "gpu"  # queues of runs that any machine can do; a scene with the tag gpu goes to that one
QUEUE = "AUG3D_QUEUE"
LISTENING = "AUG3D_LISTENING"  # the number of a socket that listens already, of the process that started the server
PASSWORD = "AUG3D_PASSWORD"
# Each may stand in a file instead, which the same name with _FILE names: addresses of databases hold passwords too
_SECRETS = (
    PASSWORD,
    "PREFECT_API_DATABASE_CONNECTION_URL",
    "MLFLOW_BACKEND_STORE_URI",
    "AWS_ACCESS_KEY_ID",
    "AWS_SECRET_ACCESS_KEY",
)
_LEAST_CHARACTERS, _LEAST_DIFFERENT = 12, 5
_HOST, _NAMES = "AUG3D_HOST", "AUG3D_NAMES"
_PREFECT_PORT, _MLFLOW_PORT = "AUG3D_PREFECT_PORT", "AUG3D_MLFLOW_PORT"
_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # listening on all addresses -> where this machine reaches it
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_HEALTHY = {PREFECT: "/api/health", MLFLOW: "/health"}


@dataclass(frozen=True)
class Serving:
    """Where the services keep their things and listen, and the password that the user chose, or the token made instead."""

    home: Path
    host: str = "127.0.0.1"
    prefect_port: int = 4200
    mlflow_port: int = 5000
    password: str = field(default="", repr=False)
    names: tuple[str, ...] = ()  # under which a proxy publishes the pages

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
        own = {HOME_VARIABLE: str(self.home), _HOST: self.host, PASSWORD: self.password, _NAMES: ",".join(self.names)}
        return {**own, **ports}

    def address(self, name: str) -> str:
        """Return the address of a server's pages."""
        return self.prefect if name == PREFECT else self.mlflow

    def healthy_at(self, name: str) -> str:
        """Return the address that tells everybody whether a server is healthy."""
        return f"{self.address(name)}{_HEALTHY[name]}"

    def signed_in(self, name: str) -> str:
        """Return the address that signs a browser in."""
        return f"{self.address(name)}/?{TOKEN}={self.password}"

    def door(self, name: str) -> Door:
        """Return what the guard before a server asks for."""
        return Door(self.password, frozenset({*_names(self.host), *self.names}), _HEALTHY[name])

    def user_and_password(self) -> str:
        """Return the two as Prefect's clients are given them."""
        return f"{USER}:{self.password}"


def serving_from(environment: Mapping[str, str]) -> Serving:
    """Read where and how to serve; raises UsageError if that is open to others without a password."""
    environment = secrets_read(environment)
    serving = Serving(
        home=Path(environment.get(HOME_VARIABLE, DEFAULT_HOME)).resolve(),
        host=environment.get(_HOST, "127.0.0.1"),
        prefect_port=int(environment.get(_PREFECT_PORT, "4200")),
        mlflow_port=int(environment.get(_MLFLOW_PORT, "5000")),
        password=environment.get(PASSWORD, ""),
        names=names_in(environment),
    )
    check_password(serving)
    return serving


def secrets_read(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment with the secrets that stand in files; raises UsageError if such a file cannot be read."""
    read = dict(environment)
    for name in _SECRETS:
        file = environment.get(f"{name}_FILE")
        if environment.get(name) or not file:
            continue
        try:
            read[name] = Path(file).read_text().strip("\r\n")
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{name}_FILE={file} cannot be read: {error}", "name a text file that holds it") from error
    return read


def queues_from(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Return the queues that this machine is to serve, of those that any can; raises UsageError for another."""
    chosen = environment.get(QUEUE, "").strip()
    if chosen not in ("", CPU, GPU):
        raise UsageError(f"{QUEUE}={chosen} is no queue", f"set it to {CPU} or {GPU}; without it both are served")
    return (chosen,) if chosen else (CPU, GPU)


def names_in(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names under which a proxy publishes the pages."""
    return tuple(name.strip().lower() for name in environment.get(_NAMES, "").split(",") if name.strip())


def check_password(serving: Serving) -> None:
    """Raise UsageError if others than this machine's users could reach the pages without a password, or by a poor one."""
    if not serving.password:
        if serving.host not in _LOOPBACK:
            raise UsageError(
                f"--host {serving.host} opens the pages, and so this machine, to whoever can reach it",
                f"set {PASSWORD} in the environment ({_LEAST_CHARACTERS} characters or more), or leave --host out",
            )
        return
    counted = "".join(serving.password.split())
    if len(counted) < _LEAST_CHARACTERS or len(set(counted)) < _LEAST_DIFFERENT:
        raise UsageError(
            f"{PASSWORD} is too poor: {len(counted)} characters that are no spaces, {len(set(counted))} different ones",
            f"take {_LEAST_CHARACTERS} or more, {_LEAST_DIFFERENT} of them different",
        )


def with_secret(serving: Serving) -> Serving:
    """Return what is served with a secret: the user's password, or else the token of the home, made at its first start.

    The token stays, so that a browser stays signed in. The folder is closed to others before it is written.
    """
    serving.folder.mkdir(parents=True, exist_ok=True)
    serving.folder.chmod(0o700)
    return serving if serving.password else replace(serving, password=_token(serving.folder / layout.SERVICES_TOKEN))


def _token(file: Path) -> str:
    try:
        kept = file.read_text() if file.exists() else ""
        if len(kept) < _LEAST_CHARACTERS:  # none, or one that was never written to its end
            kept = secrets.token_hex()
            new = file.with_suffix(f".{os.getpid()}")
            new.touch(0o600)
            new.write_text(kept)
            new.replace(file)
        file.chmod(0o600)
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{file} cannot be used: {error}", "delete it, and the next start makes another") from error
    return kept


def _reached(host: str) -> str:
    host = _EVERYWHERE.get(host, host)
    return f"[{host}]" if ":" in host else host


def _names(host: str) -> list[str]:
    """Return every name by which a browser may have reached the pages; others are turned away (DNS rebinding)."""
    if host in _LOOPBACK:
        return ["127.0.0.1", "localhost", "[::1]"]
    if host not in _EVERYWHERE:
        return [_reached(host).lower()]
    import psutil  # which the server of a run does without

    addresses = [address for found in psutil.net_if_addrs().values() for address in found]
    numbers = [a.address.partition("%")[0] for a in addresses if a.family in (socket.AF_INET, socket.AF_INET6)]
    return ["localhost", *map(str.lower, [socket.gethostname(), socket.getfqdn(), *map(_reached, numbers)])]
