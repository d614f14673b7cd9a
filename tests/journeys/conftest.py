"""What the journeys through a finished scene share: making it takes a minute."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from flows.server import prefect_server
from flows.settings import local_environment
from tests.journeys.small_town import OVERRIDES


@pytest.fixture(scope="session", autouse=True)
def own_environment() -> Iterator[None]:
    """Start programs as a user does: without what the tests before have set for Prefect and MLflow in this process."""
    ours = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith(("PREFECT_", "MLFLOW_"))}
    yield
    os.environ.update(ours)


@pytest.fixture(scope="session")
def served(own_environment: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Return an environment in which programs find a Prefect server: starting one takes each of them seconds."""
    home = tmp_path_factory.mktemp("served")
    with ExitStack() as stack:
        with pytest.MonkeyPatch.context() as patch:
            for name, value in local_environment(home).items():
                patch.setenv(name, value)
            stack.enter_context(prefect_server(home))()
            own = {name: os.environ.pop(name) for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING")}
        yield {**os.environ, **own}


@pytest.fixture(scope="session")
def home(own_environment: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the home of the journeys through the small town."""
    return tmp_path_factory.mktemp("demo")


@pytest.fixture(scope="session")
def first(home: Path) -> dict[str, Any]:
    """Make the small town, and return what its first run told."""
    aug3d = str(Path(sys.executable).parent / "aug3d")
    words = [aug3d, "demo", "--json", "--home", str(home), *OVERRIDES]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode in (0, 3), done.stderr[-3000:] + done.stdout[-2000:]
    return json.loads(done.stdout)
