"""`aug3d up`: Prefect, MLflow and the worker with one command; Ctrl-C ends all of them."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from filelock import FileLock, Timeout
from rich.console import Console

from aug3d_core.run.errors import UsageError
from aug3d_core.run.limits import limits_from
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME, Home
from flows.refusal import typed_errors
from flows.server import own_database
from flows.serving import (
    MLFLOW,
    PASSWORD,
    PREFECT,
    WORKER,
    Serving,
    check_password,
    names_in,
    queues_from,
    with_secret,
)
from flows.supervisor import Stopped, Supervised, Supervisor, terminable
from tasks.fresh_database import set_aside

_LOOPBACK = "127.0.0.1"
_ENTRY = ("-m", "flows.services")


def up(
    home: Home = DEFAULT_HOME,
    host: Annotated[
        str, typer.Option(help=f"Address to listen on; for any but this machine's own, {PASSWORD} must be set.")
    ] = _LOOPBACK,
    prefect_port: Annotated[int, typer.Option(min=1, max=65535, help="Port of Prefect's pages.")] = 4200,
    mlflow_port: Annotated[int, typer.Option(min=1, max=65535, help="Port of MLflow's pages.")] = 5000,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON for programs once all is healthy; progress goes to stderr.")
    ] = False,
) -> None:
    """Start Prefect's pages, MLflow's pages and the worker that runs scenes; Ctrl-C ends everything.

    A service that dies is started again. Nothing is open to others: the pages ask for the password, or for a token that the
    address printed here brings along; a browser that was signed in stays so. See also --host.
    """
    with typed_errors(as_json, home):
        password, names = os.environ.get(PASSWORD, ""), names_in(os.environ)
        serving = Serving(home.resolve(), host, prefect_port, mlflow_port, password, names)
        with suppress(Stopped):
            serve(serving, as_json)


def serve(serving: Serving, as_json: bool, worker: Sequence[str] = (*_ENTRY, WORKER)) -> None:
    """Serve until interrupted; `worker` are the arguments of Python that the worker is started with.

    Raises UsageError for a port in use, a home already served, or an open door without a password; StoreError for a
    service that does not start.
    """
    console = Console(stderr=True)

    def say(what: str) -> None:
        console.print(f"{time.strftime('%H:%M:%S')} {what}", markup=False, highlight=False, soft_wrap=True)

    check_password(serving)
    limits_from(os.environ)  # the worker's stages have them
    queues_from(os.environ)
    started = time.monotonic()
    Store(serving.home).check_writable()  # a folder that cannot be used is told before anything is started
    own_password = bool(serving.password)
    with _only_one(serving) as running:
        check_ports(serving)
        serving = with_secret(serving)
        arguments = {PREFECT: (*_ENTRY, PREFECT), MLFLOW: (*_ENTRY, MLFLOW), WORKER: worker}
        services = [Supervised(name, serving, line) for name, line in arguments.items()]
        with terminable(), Supervisor(services, say) as supervisor:
            database = own_database(serving.home)
            if database and (aside := set_aside(database)):
                say(aside)
            say(f"starting Prefect, MLflow and the worker; everything goes to {serving.home}")
            supervisor.start(PREFECT, MLFLOW)
            supervisor.start(WORKER)
            told = _told(serving, time.monotonic() - started)
            running.write_text(json.dumps(told, indent=1))
            _print(told, serving, as_json, own_password)
            supervisor.watch()


@contextmanager
def _only_one(serving: Serving) -> Iterator[Path]:
    """Hold the home, and yield the file that tells what serves it; raises UsageError if another `aug3d up` holds it."""
    serving.folder.mkdir(mode=0o700, exist_ok=True)
    running = serving.folder / layout.SERVICES_RUNNING
    try:
        with FileLock(serving.folder / layout.SERVICES_LOCK, timeout=0):
            running.write_text(json.dumps(_told(serving, 0.0), indent=1))
            try:
                yield running
            finally:
                running.unlink(missing_ok=True)
    except Timeout:
        with suppress(OSError, ValueError):
            first = json.loads(running.read_bytes())
            raise UsageError(
                f"aug3d up (process {first['pid']}) serves {serving.home} already: "
                f"Prefect at {first['prefect']}, MLflow at {first['mlflow']}",
                "open those, or end it with Ctrl-C first",
            ) from None
        raise UsageError(f"another aug3d up serves {serving.home} already", "end that one first") from None


def is_served(home: Path) -> bool:
    """Say whether an `aug3d up` holds a home: one that was killed leaves the file that tells of it, but not the lock."""
    try:
        with (home / layout.SERVICES / layout.SERVICES_LOCK).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # no lock, or one that this user may not see
        return False
    return False


def check_ports(serving: Serving) -> None:
    """Raise UsageError that names who holds a port, or an address that is not this machine's."""
    if serving.prefect_port == serving.mlflow_port:
        raise UsageError(f"Prefect and MLflow cannot both have port {serving.mlflow_port}", "give them different ones")
    for option, port in (("--prefect-port", serving.prefect_port), ("--mlflow-port", serving.mlflow_port)):
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(serving.host, port, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a port just given back is free
                probe.bind(address)
        except PermissionError as error:
            raise UsageError(
                f"port {port} may not be taken: {error.strerror}", f"choose {option} above 1023"
            ) from error
        except OSError as error:
            if holder := _holder(port):
                raise UsageError(f"port {port} is in use by {holder}", f"end it, or choose another {option}") from error
            raise UsageError(f"cannot listen on {serving.host}, port {port}: {error.strerror}", "see --host") from error


def _holder(port: int) -> str | None:
    """Return who listens on a port, as far as this user may see it; None if nobody does."""
    try:
        listening = [c for c in psutil.net_connections("tcp") if c.status == psutil.CONN_LISTEN and c.laddr]
    except psutil.AccessDenied:
        return "a process of another user"
    holders = [c.pid for c in listening if c.laddr.port == port]  # pyright: ignore[reportAttributeAccessIssue]
    if not holders:
        return None
    try:
        process = psutil.Process(next(pid for pid in holders if pid))
        return f"process {process.pid} ({' '.join(process.cmdline())[:100]})"
    except (StopIteration, psutil.Error):
        return "a process of another user"


def _told(serving: Serving, seconds: float) -> dict[str, Any]:
    addresses = {"prefect": serving.prefect, "mlflow": serving.mlflow}
    return {**addresses, "home": str(serving.home), "pid": os.getpid(), "seconds": round(seconds, 1)}


def _print(told: dict[str, Any], serving: Serving, as_json: bool, own_password: bool) -> None:
    """Tell where the pages are: the addresses sign a browser in, unless the user has a password for that."""
    pages = {name: serving.address(name) if own_password else serving.signed_in(name) for name in (PREFECT, MLFLOW)}
    if as_json:
        print(json.dumps({**told, "open": pages}), flush=True)
        return
    print(f"\nready after {told['seconds']:.0f} s")
    print(f"  Prefect  {pages[PREFECT]}\n           run and schedule scenes, watch them, read why one failed")
    print(f"  MLflow   {pages[MLFLOW]}\n           compare runs, find models")
    print(f"Both ask for the password in {PASSWORD}." if own_password else "Either address signs a browser in to both.")
    print("Ctrl-C ends both pages and the worker.\n", flush=True)
