"""What the services are started with: no secret where others read it, no open door, no page of another site let in."""

from __future__ import annotations

import stat
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.linux_process import SUPERVISED
from flows import services
from flows.preflight import check_servers
from flows.serving import (
    MLFLOW,
    PASSWORD,
    PREFECT,
    WORKER,
    Serving,
    check_password,
    queues_from,
    serving_from,
    with_secret,
)
from tests.flows.guarded_server import SECRET, guarded_server


@pytest.mark.parametrize("name", [PREFECT, MLFLOW, WORKER])
def test_no_command_line_holds_a_secret(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_BACKEND_STORE_URI", f"postgresql://u:{SECRET}@h/d")
    assert SECRET not in " ".join(services.command(name)) + repr(Serving(tmp_path, password=SECRET))


def test_what_is_read_from_the_environment_is_what_was_written_there(tmp_path: Path) -> None:
    serving = Serving(tmp_path, "0.0.0.0", 1234, 5678, SECRET, ("aug3d.example.org",))
    assert serving_from(serving.as_environment()) == serving


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "example.org"])
def test_an_address_that_others_reach_needs_a_password(host: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=f"--host {host} opens the pages") as refused:
        serving_from(Serving(tmp_path, host).as_environment())
    assert PASSWORD in refused.value.remedy
    assert serving_from(Serving(tmp_path, host, password=SECRET).as_environment()).password == SECRET


def test_a_short_password_is_refused_without_being_shown(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="too poor: 6 characters") as refused:
        check_password(Serving(tmp_path, password="secret"))
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize("password", [" " * 20, "\t \n" * 8, "  eleven char  ", "a" * 20, "abab" * 5])
def test_a_password_of_spaces_or_of_one_letter_is_refused(password: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="too poor"):
        serving_from(Serving(tmp_path, password=password).as_environment())


def test_a_password_may_stand_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(f"{SECRET}\n")
    told = {f"{PASSWORD}_FILE": str(tmp_path / "secret"), "AUG3D_HOST": "0.0.0.0"}
    assert serving_from(told).password == SECRET
    with pytest.raises(UsageError, match=f"{PASSWORD}_FILE"):
        serving_from({f"{PASSWORD}_FILE": str(tmp_path / "none")})


def test_a_home_has_one_token_that_only_its_owner_reads(tmp_path: Path) -> None:
    first = with_secret(Serving(tmp_path / "one"))
    assert with_secret(Serving(tmp_path / "one")) == first != with_secret(Serving(tmp_path / "two"))
    check_password(first)
    [file] = first.folder.iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600 and stat.S_IMODE(first.folder.stat().st_mode) == 0o700
    file.write_text("torn")
    assert len(with_secret(Serving(tmp_path / "one")).password) >= 64
    assert with_secret(Serving(tmp_path / "one", password=SECRET)).password == SECRET


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_this_machine_alone_needs_none(host: str, tmp_path: Path) -> None:
    check_password(Serving(tmp_path, host))


def test_clients_get_the_password_and_where_they_find_the_servers(tmp_path: Path) -> None:
    made = services.settings(WORKER, Serving(tmp_path, "::", 1234, 5678, SECRET))
    assert made["PREFECT_API_URL"] == "http://[::1]:1234/api" and made["MLFLOW_TRACKING_URI"] == "http://[::1]:5678"
    assert made["PREFECT_API_AUTH_STRING"] == f"admin:{SECRET}" and made["MLFLOW_TRACKING_PASSWORD"] == SECRET


def test_the_door_knows_the_names_of_this_machine_and_of_the_proxy_alone(tmp_path: Path) -> None:
    assert Serving(tmp_path).door(PREFECT).names == {"127.0.0.1", "localhost", "[::1]"}
    named = Serving(tmp_path, "0.0.0.0", password=SECRET, names=("aug3d.example.org",)).door(MLFLOW)
    assert {"127.0.0.1", "localhost", "aug3d.example.org"} <= named.names and named.healthy == "/health"
    assert Serving(tmp_path, "192.0.2.7").door(MLFLOW).names == {"192.0.2.7"}


def test_files_stay_on_a_disk_that_is_shared_and_go_through_the_server_where_none_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = services.settings(MLFLOW, Serving(tmp_path))
    assert shared["MLFLOW_DEFAULT_ARTIFACT_ROOT"].startswith("file://") and shared["MLFLOW_SERVE_ARTIFACTS"] == "false"
    monkeypatch.setenv("MLFLOW_ARTIFACTS_DESTINATION", "s3://aug3d")
    assert "MLFLOW_DEFAULT_ARTIFACT_ROOT" not in services.settings(MLFLOW, Serving(tmp_path))


def test_only_the_owner_reads_what_the_services_keep(tmp_path: Path) -> None:
    """The entry itself, told to become a Python that does nothing."""
    serving = Serving(tmp_path)
    become = (
        "import flows.services as s; s.command = lambda *_: ['-c', '']; "
        f"s._become({PREFECT!r}, s.serving_from({serving.as_environment()!r}))"
    )
    subprocess.run([sys.executable, "-c", become], check=True, cwd=Path(__file__).parents[2])
    files = [serving.folder, *serving.folder.iterdir()]
    assert [file.name for file in files] == ["services", "token"]
    assert all(not stat.S_IMODE(file.stat().st_mode) & 0o077 for file in files)


@pytest.mark.parametrize("words", [["nonsense"], ["check", "nonsense"], ["stop", PREFECT]])
def test_a_service_that_there_is_not(words: list[str]) -> None:
    done = subprocess.run([sys.executable, "-m", "flows.services", *words], capture_output=True, text=True)
    assert done.returncode == 2 and "there is no service" in done.stderr and SUPERVISED not in done.stderr


@pytest.fixture
def guarded() -> Iterator[int]:
    """A server that asks for `SECRET`; yields its port."""
    with guarded_server() as port:
        yield port


@pytest.mark.parametrize("password", ["", "wrong password"])
@pytest.mark.parametrize("other", ["PREFECT_API_URL", "MLFLOW_TRACKING_URI"])
def test_a_wrong_password_is_told_before_anything_is_started(
    other: str, password: str, guarded: int, tmp_path: Path
) -> None:
    clients = services.clients(Serving(tmp_path, prefect_port=guarded, mlflow_port=guarded, password=password))
    del clients[other]
    with pytest.raises(StoreError, match=f"{guarded}.* does not take the password") as refused:
        check_servers(clients)
    assert "PASSWORD" in refused.value.remedy or "AUTH_STRING" in refused.value.remedy
    assert not password or password not in str(refused.value)


def test_the_right_password_is_taken(guarded: int, tmp_path: Path) -> None:
    check_servers(services.clients(Serving(tmp_path, prefect_port=guarded, mlflow_port=guarded, password=SECRET)))


def test_limits_outlive_a_restart_of_prefect(tmp_path: Path) -> None:
    """A lease that a server forgets ends the run that holds it, minutes later."""
    module = services.settings(PREFECT, Serving(tmp_path))["PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE"]
    assert module.endswith("filesystem") and find_spec(module) is not None


def test_a_machine_serves_the_queue_that_it_is_told_to_or_both() -> None:
    assert queues_from({}) == queues_from({"AUG3D_QUEUE": ""}) == ("cpu", "gpu")
    assert queues_from({"AUG3D_QUEUE": "gpu"}) == ("gpu",)
    with pytest.raises(UsageError, match="AUG3D_QUEUE=tpu is no queue"):
        queues_from({"AUG3D_QUEUE": "tpu"})


@pytest.mark.parametrize("name", [services.SCHEDULER, services.HELPER])
def test_a_service_of_dask_wants_the_address_of_its_scheduler(name: str) -> None:
    with pytest.raises(UsageError, match="AUG3D_DASK is not set"):
        services._scheduler(name, {"AUG3D_DASK": " "})
    assert services._scheduler(WORKER, {}) == ""


def test_dask_listens_where_its_address_says_and_shows_no_pages() -> None:
    words = services.command(services.SCHEDULER, "tcp://[::1]:8786")
    assert words[words.index("--host") + 1] == "::1" and words[words.index("--port") + 1] == "8786"
    assert "--no-dashboard" in words and "--no-dashboard" in services.command(services.HELPER, "tcp://127.0.0.1:8786")
