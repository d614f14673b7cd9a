"""Servers and weights that the user named: looked at before hours of work."""

from __future__ import annotations

import socket
import threading
from contextlib import nullcontext
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.factory.config import scene_config
from aug3d_core.run.errors import InputError, StoreError
from flows.cli import app
from flows.preflight import check_servers, check_weights


def test_prefect_must_be_reached_and_mlflow_may_be_told_later() -> None:
    with socket.socket() as taken:  # bound but not listening: nothing answers there
        taken.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{taken.getsockname()[1]}/api"
        check_servers({"MLFLOW_TRACKING_URI": address})
        with pytest.raises(StoreError, match=f"{address} .from PREFECT_API_URL. cannot be reached"):
            check_servers({"PREFECT_API_URL": address})


@pytest.mark.parametrize("server", ["PREFECT_API_URL", "MLFLOW_TRACKING_URI"])
@pytest.mark.parametrize(("answer", "refused"), [(401, True), (403, True), (404, False), (500, False), (200, False)])
def test_a_password_that_a_server_does_not_take(server: str, answer: int, refused: bool) -> None:
    class Door(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(answer)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Door) as door:
        threading.Thread(target=door.serve_forever, daemon=True).start()
        environment = {server: f"http://127.0.0.1:{door.server_port}"}
        with pytest.raises(StoreError, match="does not take the password") if refused else nullcontext():
            check_servers(environment)
        door.shutdown()


@pytest.mark.parametrize("port", ["", ":{port}"])
def test_a_password_in_an_address_is_used_and_never_shown(port: str) -> None:
    asked = []

    class Door(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.headers["Authorization"])
            self.send_response(401)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Door) as door:
        threading.Thread(target=door.serve_forever, daemon=True).start()
        address = f"http://user:secret@127.0.0.1{port.format(port=door.server_port)}"
        with pytest.raises(StoreError) if port else nullcontext() as told:
            check_servers({"MLFLOW_TRACKING_URI": address})
        door.shutdown()
    if port:
        assert "secret" not in told.value.problem and asked == ["Basic dXNlcjpzZWNyZXQ="]


@pytest.mark.parametrize(
    "line", ["demo", "demo --dry-run", "scenes add hill --town", "collections add all --towns 2", "run hill --photos ."]
)
def test_first_weights_that_are_not_there_are_told_before_anything_is_made(line: str, tmp_path: Path) -> None:
    missing = tmp_path / "weights.safetensors"
    words = [*line.split(), "--set", f"training.head.start={missing}", "--home", str(tmp_path / "home")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1 and f"there is no file {missing}" in done.output.replace("\n", "")
    assert "training.head.start=random" in done.output
    assert not list((tmp_path / "home").rglob("*.yaml")) and not (tmp_path / "home" / "prefect").exists()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["sampling.method=sam"], "sampling.sam_weights is empty"),
        (["sampling.method=sam", "sampling.sam_weights=/not/there"], "/not/there is no folder and no name on the hub"),
        (["sampling.method=sam", "sampling.domes=0"], ""),
        (["sampling.sam_weights=/not/there"], ""),
        (["training.head=pixelnerf", "training.head.encoder_weights=/not/there"], ""),  # the small encoder has none
        (
            ["training.head=pixelnerf", "training.head.encoder=resnet34", "training.head.encoder_weights=/not/there"],
            "training.head.encoder_weights /not/there is no file that can be read (No such file or directory)",
        ),
        (
            ["training.head=pixelnerf", "training.head.encoder=resnet34", "training.head.encoder_weights="],
            "training.head.encoder_weights . is no file that can be read",
        ),
    ],
)
def test_other_weights_are_looked_at_where_a_stage_would_use_them(
    settings: list[str], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aug3d_core.domes.sam_weights.find_spec", lambda name: name)
    with pytest.raises(InputError) if said else nullcontext() as told:
        check_weights(scene_config("tiny", settings))
    if said:
        assert said in told.value.problem


def test_a_library_that_is_not_installed_is_told_before_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aug3d_core.domes.sam_weights.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"transformers.*\n.*pip install"):
        check_weights(scene_config("tiny", ["sampling.method=sam", "sampling.sam_weights=facebook/sam-vit-base"]))
