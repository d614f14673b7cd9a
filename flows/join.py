"""`aug3d worker`: let this machine, too, take runs of the Prefect server of another."""

from __future__ import annotations

import os
import secrets
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import typer

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import UsageError
from aug3d_core.run.limits import limits_from
from aug3d_core.scene_files.files import REGISTRY
from aug3d_core.scene_files.mirror import bring
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.store import Store
from flows.guard import USER
from flows.options import DEFAULT_HOME
from flows.preflight import check_servers
from flows.refusal import typed_errors
from flows.services import TOLD, ready_file
from flows.serving import PASSWORD, QUEUE
from flows.settings import HOME_VARIABLE, local_environment
from tasks.ping import unreachable

ASKING = {"PREFECT_WORKER_QUERY_SECONDS": "5"}  # a question costs the server, which all share, 12 ms of a processor
_API, _AUTH, _MLFLOW = "PREFECT_API_URL", "PREFECT_API_AUTH_STRING", "MLFLOW_TRACKING_URI"


def worker(
    server: Annotated[
        str,
        typer.Option(envvar="AUG3D_SERVER", help="Address of Prefect's pages, as aug3d up tells it: http://HOST:4200."),
    ],
    store: Annotated[
        str, typer.Option(envvar=SHARED_VARIABLE, help="Store that all machines share: s3://BUCKET/PREFIX.")
    ] = "",
    queue: Annotated[
        Literal["cpu", "gpu"] | None,
        typer.Option(envvar=QUEUE, help="Take only these runs; gpu: scenes with the tag gpu. Without it, both."),
    ] = None,
    home: Annotated[
        Path, typer.Option(envvar=HOME_VARIABLE, help="Folder of this machine for what it makes and reads.")
    ] = DEFAULT_HOME,
) -> None:
    """Take runs of the Prefect server of another machine, until Ctrl-C. The results go to the shared store.

    The secret is read from AUG3D_PASSWORD (or AUG3D_PASSWORD_FILE), or from PREFECT_API_AUTH_STRING (user:password).
    """
    with typed_errors(as_json=False, home=home):
        environment = joined(os.environ, server, store, queue, home.resolve())
        check(environment)
        os.execve(sys.executable, [sys.executable, "-m", "flows.joined_worker"], environment)


def joined(environment: Mapping[str, str], server: str, store: str, queue: str | None, home: Path) -> dict[str, str]:
    """Return the environment of a worker; raises UsageError for a missing store."""
    if not store:
        raise UsageError(
            "a worker needs a store that all machines share, and there is no address of one",
            f"set {SHARED_VARIABLE}, or give --store s3://BUCKET/PREFIX, as on the machine of aug3d up",
        )
    own = {_API: f"{server.rstrip('/').removesuffix('/api')}/api", SHARED_VARIABLE: store, HOME_VARIABLE: str(home)}
    if password := environment.get(PASSWORD):
        own |= {_AUTH: f"{USER}:{password}"}
        if environment.get(_MLFLOW):
            own |= {"MLFLOW_TRACKING_USERNAME": USER, "MLFLOW_TRACKING_PASSWORD": password}
    if queue:
        own[QUEUE] = queue
    return {**local_environment(home), **TOLD, **ASKING, **environment, **own}


def check(environment: Mapping[str, str]) -> None:
    """Raise an error, with its remedy, for what would keep a worker from working: server, secret, store, home."""
    limits_from(environment)
    address = environment[_API]
    if not address.startswith(("http://", "https://")):
        raise UsageError(f"--server {address} is not an address", "give it as aug3d up tells it: http://HOST:4200")
    if why := unreachable(address):
        raise UsageError(
            f"the Prefect server at {address} cannot be reached: {why}",
            "see --server, and that aug3d up runs there with --host, so that other machines reach it",
        )
    check_servers(environment)
    os.environ[SHARED_VARIABLE] = environment[SHARED_VARIABLE]
    store = Store(Path(environment[HOME_VARIABLE]))
    store.check_writable()
    ready_file(store.root).unlink(missing_ok=True)  # an earlier worker's
    assert store.shared is not None
    bucket, name = store.shared.bucket, f"workers/{secrets.token_hex(8)}"
    bucket.put(name, b"")  # one that we may only read is told before anything is started
    bucket.delete([name])
    bring(store, bucket, (REGISTRY, COLLECTIONS))
