"""`aug3d worker`: what it refuses before it takes a run, and where its secrets stand."""

from __future__ import annotations

import os
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest
from typer.testing import CliRunner

from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import REGISTRY, write_scene
from aug3d_core.scene_files.mirror import share
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store
from flows.cli import app
from flows.join import check, joined
from tests.flows.guarded_server import SECRET, guarded_server

SECRETS = {name: KEYS[name] for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")}


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Return the address of a server that asks for `SECRET`."""
    with guarded_server() as port:
        yield f"http://127.0.0.1:{port}"


@pytest.fixture(scope="module")
def service() -> Iterator[str]:
    with s3_service() as address:
        yield address


@pytest.fixture
def environment(service: str, server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Return the environment of a worker that has all that it needs."""
    for name, value in {**KEYS, "AWS_ENDPOINT_URL": service}.items():
        monkeypatch.setenv(name, value)
    store = f"s3://{BUCKET}/{tmp_path.name}"
    monkeypatch.setenv("AUG3D_STORE", store)
    owner = Store(tmp_path / "owner")
    write_scene(owner, "hill", SceneEntry(photos=None))
    share(owner, Bucket(store), (REGISTRY,))
    return joined({**os.environ, "AUG3D_PASSWORD": SECRET}, server, store, None, tmp_path / "home")


def test_with_all_that_it_needs_it_knows_the_scenes(environment: dict[str, str], tmp_path: Path) -> None:
    check(environment)
    assert (tmp_path / "home" / "scenes" / "hill.yaml").exists()
    assert Bucket(environment["AUG3D_STORE"]).names("") == ["registry.json"], "what it tried is gone"


@pytest.fixture
def in_files(environment: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process have its secrets in files alone, as docker-compose.yml gives them."""
    for name, value in {**SECRETS, "AUG3D_PASSWORD": SECRET}.items():
        (tmp_path / name).write_text(f"{value}\n")
        monkeypatch.setenv(f"{name}_FILE", str(tmp_path / name))
        monkeypatch.setenv(name, "")  # so that what the command sets is gone after the test
        monkeypatch.delenv(name)


def test_secrets_that_stand_in_files_open_the_store_and_the_server(
    in_files: None, server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    began: list[dict[str, str]] = []
    monkeypatch.setattr(os, "execve", lambda _, words, environment: began.append(environment))
    words = ["worker", "--server", server, "--home", str(tmp_path / "home")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    [environment] = began
    assert environment["PREFECT_API_AUTH_STRING"] == f"admin:{SECRET}"
    assert {name: environment[name] for name in SECRETS} == SECRETS
    assert (tmp_path / "home" / "scenes" / "hill.yaml").exists()


def test_any_command_in_a_worker_s_container_reads_the_shared_store(in_files: None, tmp_path: Path) -> None:
    write_scene(Store(tmp_path / "home"), "hill", SceneEntry(photos=None))
    result = CliRunner().invoke(app, ["scenes", "list", "--home", str(tmp_path / "home")])
    assert result.exit_code == 0 and "hill" in result.stdout, result.output


def test_a_secret_whose_file_is_gone_is_told_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY_FILE", str(tmp_path / "none"))
    refused = CliRunner().invoke(app, ["scenes", "list", "--home", str(tmp_path)])
    assert refused.exit_code == 2 and "AWS_SECRET_ACCESS_KEY_FILE" in refused.stderr


def test_the_server_is_found_and_told_the_password() -> None:
    told = joined(
        {"AUG3D_PASSWORD": SECRET, "MLFLOW_TRACKING_URI": "http://far:5000"},
        "http://far:4200/",
        "s3://b",
        "gpu",
        Path("/h"),
    )
    assert told["PREFECT_API_URL"] == "http://far:4200/api" and told["PREFECT_API_AUTH_STRING"] == f"admin:{SECRET}"
    assert told["MLFLOW_TRACKING_PASSWORD"] == SECRET and told["AUG3D_QUEUE"] == "gpu" and told["AUG3D_HOME"] == "/h"
    same = joined({"PREFECT_API_AUTH_STRING": "admin:x"}, "http://far:4200/api", "s3://b", None, Path("/h"))
    assert same["PREFECT_API_URL"] == "http://far:4200/api" and same["PREFECT_API_AUTH_STRING"] == "admin:x"
    assert "AUG3D_QUEUE" not in same


def test_no_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AUG3D_STORE", raising=False)
    result = CliRunner().invoke(app, ["worker", "--server", "http://127.0.0.1:1", "--home", str(tmp_path / "home")])
    assert result.exit_code == 2 and "AUG3D_STORE" in result.output and not (tmp_path / "home").exists()


@pytest.mark.parametrize(
    ("address", "told"), [("http://127.0.0.1:1", "cannot be reached"), ("far:4200", "is not an address")]
)
def test_a_server_that_is_not_there(address: str, told: str, environment: dict[str, str]) -> None:
    with pytest.raises(UsageError, match=told) as refused:
        check({**environment, "PREFECT_API_URL": f"{address}/api"})
    assert "aug3d up" in refused.value.remedy


@pytest.mark.parametrize("secret", ["", "admin:a wrong password"])
def test_a_secret_that_the_server_does_not_take(secret: str, environment: dict[str, str]) -> None:
    with pytest.raises(StoreError, match="does not take the password") as refused:
        check({**environment, "PREFECT_API_AUTH_STRING": secret})
    assert "AUG3D_PASSWORD" in refused.value.remedy and (not secret or secret not in str(refused.value))


def test_a_store_that_does_not_let_us_in(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    class Forbids(BaseHTTPRequestHandler):
        def do_PUT(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(403)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Forbids) as closed:
        thread = Thread(target=closed.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{closed.server_port}")
        try:
            with pytest.raises(StoreError, match=f"s3://{BUCKET}.* does not let us in") as refused:
                check(environment)
        finally:
            closed.shutdown()
            thread.join()
    assert "AWS_SECRET_ACCESS_KEY" in refused.value.remedy
    assert KEYS["AWS_SECRET_ACCESS_KEY"] not in str(refused.value) + refused.value.remedy


def test_a_home_with_scene_files_of_its_own(environment: dict[str, str], tmp_path: Path) -> None:
    write_scene(Store(tmp_path / "home"), "own", SceneEntry(photos=None))
    with pytest.raises(UsageError, match="was written here"):
        check(environment)
