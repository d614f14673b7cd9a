"""`aug3d view SCENE`: a finished scene in a browser, and what its model predicts wherever the camera goes."""

from __future__ import annotations

import json
import os
import secrets
import threading
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aug3d_core.store.scenes import object_of
from aug3d_core.store.store import Store
from flows.guard import TOKEN, Door, Guard
from flows.options import DEFAULT_HOME, Home
from flows.predict import judged_with
from flows.reading import read_store, version_with
from flows.refusal import typed_errors
from flows.serving import PASSWORD, Serving, check_password, with_secret
from flows.supervisor import Stopped, terminable

if TYPE_CHECKING:
    from aug3d_core.view.predictor import Predictor
    from aug3d_core.view.viewer import Viewer

PORT = 4300
_NAMES = frozenset({"127.0.0.1", "localhost"})


def view(
    scene: Annotated[str, typer.Argument(help="Name of a scene that was run, or SCENE@VERSION as in aug3d compare.")],
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page, on this machine alone; 0: any.")
    ] = PORT,
    home: Home = DEFAULT_HOME,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for programs once the page is open.")] = False,
) -> None:
    """Fly through a finished scene in a browser: points, mesh, cameras, domes, and what its model predicts as you move.

    Click a camera for its photograph; record a path as a video, which goes to this folder.

    The page opens for whoever has the printed address, or AUG3D_PASSWORD. Ctrl-C ends it.
    """
    with typed_errors(as_json, home), suppress(Stopped):
        store = read_store(home)
        with store.using():
            _serve(store, scene, port, as_json)


def _serve(store: Store, scene: str, port: int, as_json: bool) -> None:
    version = version_with(store, scene, "sfm", "surface", "training")
    serving, own_password = _serving(store)
    # With numpy, torch and the server, which other commands do without
    from aug3d_core.view.finished import READ, photograph, read_finished
    from aug3d_core.view.server import guarded_server, listening
    from aug3d_core.view.viewer import Viewer

    def folder_of(step: str) -> Path:
        record = object_of(store, version, step)
        return store.files_dir(record, record.named(READ))

    with listening(port) as socket:
        loading = ThreadPoolExecutor(1).submit(_predictor, store, version)
        shown = read_finished(scene, folder_of)
        placed = object_of(store, version, "sfm")
        door = Door(serving.password, _NAMES, healthy="", posts=False, command="aug3d view")
        server = guarded_server(socket, lambda app: Guard(app, door), f"aug3d: {scene}")  # type: ignore[arg-type]
        viewer = Viewer(server, shown, lambda photo_id: store.file(placed, photograph(photo_id)), Path.cwd())
        with terminable():
            try:
                _tell(f"http://127.0.0.1:{socket.getsockname()[1]}/", serving.password, own_password, scene, as_json)
                loading.add_done_callback(lambda loaded: _bring(viewer, loaded))
                threading.Event().wait()
            except KeyboardInterrupt:
                return
            finally:
                wait([loading])  # seconds at most; cut off, it would end in a traceback
                viewer.close()


def _predictor(store: Store, version: Mapping[str, Any]) -> Predictor:
    dataset, training = (store.files_dir(object_of(store, version, step)) for step in ("dataset", "training"))
    from aug3d_core.view.predictor import Predictor

    return Predictor.load(dataset, training, judged_with(store, version))


def _bring(viewer: Viewer, loaded: Future[Predictor]) -> None:
    """Bring the model into the page; where there is none, the page says why and shows the rest."""
    try:
        viewer.predict_with(loaded.result())
    except Exception as error:  # what the page would wait for without end
        viewer.say(error)


def _serving(store: Store) -> tuple[Serving, bool]:
    """Return what holds the secret, and whether it is the user's own password; a home that cannot be written gets a token of
    its own each time.
    """
    serving = Serving(store.root, password=os.environ.get(PASSWORD, ""))
    check_password(serving)
    if serving.password:
        return serving, True
    return (replace(serving, password=secrets.token_hex()) if store.unwritable() else with_secret(serving)), False


def _tell(address: str, secret: str, own_password: bool, scene: str, as_json: bool) -> None:
    opened = address if own_password else f"{address}?{TOKEN}={secret}"
    if as_json:
        print(json.dumps({"scene": scene, "open": opened, "pid": os.getpid()}), flush=True)
        return
    print(f"{scene} is at {opened}")
    print(f"It asks for the password in {PASSWORD}." if own_password else "The address signs a browser in.")
    print("Ctrl-C ends it.", flush=True)
