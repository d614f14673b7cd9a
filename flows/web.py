"""A server of pages behind the guard: `python -m flows.web prefect|mlflow`, with all it needs in the environment.

It is the server of `aug3d up`, of docker-compose.yml and of a single run. Both libraries' own commands start further processes.
"""

from __future__ import annotations

import gc
import os
import socket
import sys

import uvicorn
from starlette.types import ASGIApp

from aug3d_core.run.garbage import collect_apart
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from flows.guard import Guard
from flows.serving import LISTENING, MLFLOW, PREFECT, serving_from

_GOOD_BYE_S = 3
_OWN_DOOR = "PREFECT_SERVER_API_AUTH_STRING"  # a second door of Prefect's, behind the guard


def main(name: str) -> None:
    """Serve until told to end, or, if supervised, until the parent ends."""
    if SUPERVISED in os.environ:
        die_with_parent()
    serving = serving_from(os.environ)
    door = serving.door(name)
    if not door.secret:
        raise SystemExit("no server without a secret: start it by `python -m flows.services`")
    app = {PREFECT: _prefect, MLFLOW: _mlflow}[name]()
    listening = os.environ.get(LISTENING)
    config = uvicorn.Config(
        Guard(app, door),
        host=serving.host,
        port=serving.prefect_port if name == PREFECT else serving.mlflow_port,
        log_level="warning",
        access_log=False,  # a line for every click, for months; and tokens are in addresses
        lifespan="on",
        timeout_graceful_shutdown=_GOOD_BYE_S,
    )
    server = uvicorn.Server(config)
    server.run(sockets=[socket.socket(fileno=int(listening))] if listening else None)
    if not server.started:
        raise SystemExit(3)


def _prefect() -> ASGIApp:
    os.environ.pop(_OWN_DOOR, None)
    gc.disable()  # imports make no garbage
    from prefect.server.api.server import create_app

    app = create_app()
    collect_apart()
    return app


def _mlflow() -> ASGIApp:
    from tasks.mlflow_app import mlflow_app

    return mlflow_app()


if __name__ == "__main__":
    main(sys.argv[1])
