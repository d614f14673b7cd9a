"""What every test shares: array shapes are checked, Prefect runs in a database of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from filelock import FileLock
from jaxtyping import install_import_hook

import tests.shapes  # noqa: F401  (the hook below looks it up by name)

pytest_plugins = ("tests.processes", "tests.shared_stores", "tests.dask_cluster", "tests.skips")

CORE = Path(__file__).parents[1] / "aug3d_core"
# Shapes and types in the annotations of modules that name array shapes are checked while testing, at a price for each call.
# This must run before aug3d_core is imported.
install_import_hook(
    [
        ".".join(file.relative_to(CORE.parent).with_suffix("").parts)
        for file in sorted(CORE.rglob("*.py"))
        if "jaxtyping" in file.read_text()
    ],
    "tests.shapes.checked",
)

# Repeatable, quick, and deaf to a busy machine.
hypothesis.settings.register_profile("aug3d", deadline=None, derandomize=True, max_examples=30)
hypothesis.settings.load_profile("aug3d")

REAL_PHOTOS = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def prefect_of_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Start a Prefect server with a results folder for the tests of this process; return the variables that name it."""
    from flows.server import prefect_server
    from flows.settings import local_environment

    home = tmp_path_factory.mktemp("home")
    told = local_environment(home)
    with ExitStack() as stack:
        with pytest.MonkeyPatch.context() as patch:
            for name, value in told.items():
                patch.setenv(name, value)
            stack.enter_context(prefect_server(home))()
            from prefect.settings import PREFECT_API_AUTH_STRING, PREFECT_API_URL, temporary_settings

            own = {setting: os.environ.pop(setting.name) for setting in (PREFECT_API_URL, PREFECT_API_AUTH_STRING)}
        with temporary_settings(own):  # it may be imported already
            yield {**told, **{setting.name: value for setting, value in own.items()}}


@pytest.fixture
def prefect(prefect_of_tests: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a test use the Prefect server of this process's tests."""
    for name, value in prefect_of_tests.items():
        monkeypatch.setenv(name, value)


@pytest.fixture(scope="session")
def fresh_mlflow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make an empty database of MLflow's once, to be copied into a test's store: MLflow takes seconds for it."""
    from mlflow.tracking import MlflowClient

    from aug3d_core.store import layout

    file = tmp_path_factory.mktemp("fresh") / layout.MLFLOW_DATABASE
    MlflowClient(f"sqlite:///{file}").search_registered_models()
    return file


@pytest.fixture(scope="session")
def real_photos() -> Path:
    """Return the folder of real photo sets, or skip."""
    if not REAL_PHOTOS.is_dir():
        pytest.skip(f"the real photo sets are not at {REAL_PHOTOS}")
    return REAL_PHOTOS


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Mount a disk of so many MiB and return its folder; skip where that is not allowed."""
    folder = tmp_path / "small"

    def mount(size_mib: int) -> Path:
        folder.mkdir()
        asked = ["mount", "-t", "tmpfs", "-o", f"size={size_mib}m", "tmpfs", str(folder)]
        mounted = subprocess.run(asked, capture_output=True)
        if mounted.returncode:
            pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.decode().strip()}")
        return folder

    yield mount
    if folder.is_mount():
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def read_only() -> Iterator[Callable[[Path], None]]:
    """Make a folder one that can only be read, as on a disk that is mounted so; skip where that is not allowed."""
    mounted: list[Path] = []

    def mount(folder: Path) -> None:
        bound = subprocess.run(["mount", "--bind", str(folder), str(folder)], capture_output=True)
        if bound.returncode:
            pytest.skip(f"nothing can be mounted here: {bound.stderr.decode().strip()}")
        mounted.append(folder)
        subprocess.run(["mount", "-o", "remount,bind,ro", str(folder)], check=True)

    yield mount
    for folder in mounted:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture(scope="session")
def own_environment() -> Iterator[None]:
    """Start programs as a user does: without what the tests before have set for Prefect and MLflow in this process."""
    ours = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith(("PREFECT_", "MLFLOW_"))}
    yield
    os.environ.update(ours)


@pytest.fixture(scope="session")
def small_town(own_environment: None, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Make the small town once for all processes, and return its home and what its first run told.

    Only the tests of one process may use the home: they go on with it.
    """
    from aug3d_core.bench.small_town import OVERRIDES

    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    home, told = folder / "small_town", folder / "small_town.json"
    words = [str(Path(sys.executable).parent / "aug3d"), "demo", "--json", "--home", str(home), *OVERRIDES]
    with FileLock(folder / "small_town.lock"):
        if not told.exists():
            done = subprocess.run(words, capture_output=True, text=True)
            assert done.returncode in (0, 3), done.stderr[-3000:] + done.stdout[-2000:]
            told.write_text(done.stdout)
    return home, json.loads(told.read_text())
