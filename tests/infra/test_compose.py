"""docker-compose.yml cannot be tried without a container engine: it is held to its specification and to flows/services.py."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from aug3d_core import __version__
from aug3d_core.factory.scheduler import DASK, scheduler_from
from flows.cli import app
from flows.services import settings
from flows.serving import HELPER, MLFLOW, PREFECT, SCHEDULER, WORKER, secrets_read, serving_from

ROOT = Path(__file__).parents[2]
OURS = {"prefect": PREFECT, "mlflow": MLFLOW, "worker": WORKER, "worker-gpu": WORKER}
OF_DASK = {SCHEDULER: SCHEDULER, HELPER: HELPER}


@pytest.fixture(scope="module")
def services() -> dict[str, dict[str, Any]]:
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]


def known_variables() -> dict[str, str]:
    lines = [line for line in (ROOT / ".env.example").read_text().splitlines() if line and not line.startswith("#")]
    return dict(line.split("=", 1) for line in lines)


def filled_in(text: str, values: dict[str, str]) -> str:
    """Return the text as compose would read it: `${NAME}`, `${NAME:-default}`, `${NAME:?error}`."""
    return re.sub(
        r"\$\{(\w+)(?::-([^}]*)|:\?[^}]*)?\}", lambda found: values.get(found[1]) or found[2] or "", str(text)
    )


def test_the_file_is_one_of_the_compose_specification() -> None:
    check = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec"]
    done = subprocess.run([*check, ROOT / "docker-compose.yml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(("name", "service"), [*OURS.items(), *OF_DASK.items()])
def test_our_services_are_started_and_checked_as_aug3d_up_does_it(
    name: str, service: str, services: dict[str, Any]
) -> None:
    entry = ["python", "-m", "flows.services"]
    assert services[name]["command"] == [*entry, service]
    assert services[name]["healthcheck"]["test"] == ["CMD", *entry, "check", service]


def test_another_worker_joins_with_a_home_of_its_own_and_the_same_store(services: dict[str, Any]) -> None:
    more, first = services["worker-more"], services["worker"]
    assert more["command"][:2] == ["aug3d", "worker"]
    given = typer.main.get_command(app).commands["worker"].make_context("worker", more["command"][2:]).params  # type: ignore[attr-defined]
    assert filled_in(given["server"], {}) == "http://prefect:4200"
    assert more["environment"] == first["environment"] and more["healthcheck"] == first["healthcheck"]
    homes = [{volume.split(":")[0] for volume in one["volumes"] if volume.endswith(":/data")} for one in (more, first)]
    assert homes[0].isdisjoint(homes[1])


def test_a_dask_worker_helps_the_first_worker_where_nobody_else_reaches_its_scheduler(
    services: dict[str, Any], made_secrets: Path
) -> None:
    first = services["worker"]
    for name in OF_DASK:
        helping = services[name]
        assert helping["network_mode"] == "service:worker" and not {"ports", "networks"} & helping.keys()
        assert helping["profiles"] == ["dask"]
        assert helping["environment"].items() <= first["environment"].items()  # the same store, the same scheduler
        values = {**known_variables(), DASK: "tcp://127.0.0.1:8786"}
        environment = {key: filled_in(value, values) for key, value in helping["environment"].items()}
        mounted = {f"/run/secrets/{secret}": made_secrets / secret for secret in helping["secrets"]}
        read = secrets_read({key: str(mounted.get(value, value)) for key, value in environment.items()})
        assert read["AWS_ACCESS_KEY_ID"] == (made_secrets / "s3_access_key").read_text()
        assert scheduler_from(read) == values[DASK]
        assert scheduler_from({**read, DASK: filled_in(helping["environment"][DASK], known_variables())}) == ""
    homes = [
        {volume.split(":")[0] for volume in one["volumes"] if volume.endswith(":/data")}
        for one in (services[HELPER], first)
    ]
    assert homes[0] and homes[0].isdisjoint(homes[1])


@pytest.fixture(scope="module")
def made_secrets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the script that makes the secrets, twice, in a copy; return their folder."""
    copy = tmp_path_factory.mktemp("copy")
    (copy / "infra").mkdir()
    shutil.copy(ROOT / "infra" / "make_secrets.py", copy / "infra")
    for _ in range(2):
        subprocess.run([sys.executable, copy / "infra" / "make_secrets.py"], check=True, stdout=subprocess.DEVNULL)
    return copy / "secrets"


@pytest.mark.parametrize("name", OURS)
def test_what_compose_sets_is_what_the_services_read(name: str, services: dict[str, Any], made_secrets: Path) -> None:
    environment = {key: filled_in(value, known_variables()) for key, value in services[name]["environment"].items()}
    mounted = {f"/run/secrets/{secret}": made_secrets / secret for secret in services[name]["secrets"]}
    environment = {key: str(mounted.get(value, value)) for key, value in environment.items()}
    serving = serving_from(environment)  # refuses an open door without a password
    assert serving.host == "0.0.0.0" and (serving.prefect_port, serving.mlflow_port) == (4200, 5000)
    if OURS[name] == WORKER:
        read = secrets_read(environment)
        assert {read["AWS_ACCESS_KEY_ID"], read["AWS_SECRET_ACCESS_KEY"]} == {
            (made_secrets / key).read_text() for key in ("s3_access_key", "s3_secret_key")
        }
        made = {**settings(WORKER, serving), **environment}
        assert made["PREFECT_API_URL"] == "http://prefect:4200/api"
        assert made["MLFLOW_TRACKING_URI"] == "http://mlflow:5000"
        assert made["MLFLOW_TRACKING_PASSWORD"] == (made_secrets / "aug3d_password").read_text()
    else:
        [address] = [
            value for key, value in secrets_read(environment).items() if f"{key}_FILE" in environment and "://" in value
        ]
        assert (made_secrets / "postgres_password").read_text() in address


def test_only_its_owner_enters_the_folder_of_secrets_and_what_belongs_together_agrees(made_secrets: Path) -> None:
    assert made_secrets.stat().st_mode & 0o077 == 0
    [identity] = json.loads((made_secrets / "s3.json").read_text())["identities"]
    credentials = (made_secrets / "s3_credentials").read_text()
    assert all(value in credentials for value in identity["credentials"][0].values())
    keys = [(made_secrets / name).read_text() for name in ("s3_access_key", "s3_secret_key")]
    assert keys == list(identity["credentials"][0].values())


def test_secrets_that_an_earlier_version_made_stay_and_are_completed(made_secrets: Path, tmp_path: Path) -> None:
    shutil.copytree(made_secrets.parent, tmp_path / "copy")
    (tmp_path / "copy" / "secrets" / "s3_access_key").unlink()
    (tmp_path / "copy" / "secrets" / "s3_secret_key").unlink()
    subprocess.run(
        [sys.executable, tmp_path / "copy" / "infra" / "make_secrets.py"], check=True, stdout=subprocess.DEVNULL
    )
    for file in made_secrets.iterdir():
        assert (tmp_path / "copy" / "secrets" / file.name).read_bytes() == file.read_bytes()


def test_every_service_gives_its_rights_away_and_cannot_write_its_image(services: dict[str, Any]) -> None:
    for name, service in services.items():
        assert service["cap_drop"] == ["ALL"] and service["read_only"] is True, name
        assert service["security_opt"] == ["no-new-privileges:true"] and "privileged" not in service, name
        assert any(place.startswith("/tmp") for place in service["tmpfs"]), name
        assert set(service.get("cap_add", [])) <= {"CHOWN", "DAC_OVERRIDE", "FOWNER", "SETGID", "SETUID"}, name


def test_only_the_pages_are_published_and_only_on_this_machine(services: dict[str, Any]) -> None:
    ports = {name: service["ports"] for name, service in services.items() if "ports" in service}
    assert set(ports) == {"prefect", "mlflow"}
    assert all(port.startswith("127.0.0.1:") for published in ports.values() for port in published)


def test_every_image_is_pinned_and_every_service_has_limits(services: dict[str, Any]) -> None:
    for name, service in services.items():
        _, _, tag = filled_in(service["image"], {}).partition(":")
        assert re.search(r"\d+\.\d+", tag) and "latest" not in tag, name
        assert {"cpus", "memory"} <= set(service["deploy"]["resources"]["limits"]), name
    assert re.search(r":\d+\.\d+\.\d+", base_image())


def base_image() -> str:
    """Return what our image is built from, where nobody says otherwise."""
    found = re.search(
        r"^ARG PYTHON_IMAGE=(\S+)\nFROM \$\{PYTHON_IMAGE\}$", (ROOT / "infra" / "Dockerfile").read_text(), re.M
    )
    assert found
    return found[1]


def test_the_operator_may_pin_the_images_of_others_by_digest(services: dict[str, Any]) -> None:
    ours = {name for name, service in services.items() if "build" in service}
    wanted = dict.fromkeys(("AUG3D_PYTHON_IMAGE", "AUG3D_POSTGRES_IMAGE", "AUG3D_S3_IMAGE"), "x:1@sha256:abc")
    for name, service in services.items():
        named = service["build"]["args"]["PYTHON_IMAGE"] if name in ours else service["image"]
        assert filled_in(named, wanted) == "x:1@sha256:abc", name
        assert name not in ours or filled_in(named, {}) == base_image(), name


def test_services_wait_for_the_health_of_what_they_need(services: dict[str, Any]) -> None:
    for name, service in services.items():
        for needed, how in service.get("depends_on", {}).items():
            if how["condition"] == "service_healthy":
                assert services[needed]["healthcheck"]["test"], f"{name} waits for {needed}"
            else:
                assert services[needed]["restart"] == "on-failure"


def test_secrets_are_files_alone(services: dict[str, Any], made_secrets: Path) -> None:
    text = (ROOT / "docker-compose.yml").read_text()
    assert set(re.findall(r"\$\{(\w+)", text)) | {"COMPOSE_PROFILES"} == set(known_variables())
    assert not [name for name in known_variables() if re.search("PASSWORD|SECRET|KEY", name)]
    files = yaml.safe_load(text)["secrets"]
    assert {name: f"secrets/{name}" for name in files} == {name: one["file"] for name, one in files.items()}
    assert set(files) == {file.name for file in made_secrets.iterdir()}
    assert set(files) == {secret for service in services.values() for secret in service.get("secrets", [])}
    for name, service in services.items():
        words = [str(word) for word in (*service.get("command", []), *service.get("environment", {}).values())]
        used = {found for word in words for found in re.findall(r"/run/secrets/([\w.]+)", word)}
        assert used == set(service.get("secrets", [])), name
    assert {".env", "/secrets/"} <= set((ROOT / ".gitignore").read_text().splitlines())


def test_our_image_runs_as_a_user_without_rights_and_holds_what_it_copies(services: dict[str, Any]) -> None:
    lines = (ROOT / "infra" / "Dockerfile").read_text().splitlines()
    assert "USER aug3d" in lines[-5:]
    for name in (*OURS, *OF_DASK):
        assert services[name]["cap_drop"] == ["ALL"]
        assert services[name]["image"].startswith(f"aug3d:{__version__}-")
    copied = [path for line in lines if line.startswith("COPY") for path in line.split()[1:-1]]
    allowed = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    for path in copied:
        assert (ROOT / path).exists() and any(path.startswith(prefix) for prefix in allowed), path
