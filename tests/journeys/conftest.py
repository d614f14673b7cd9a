"""What the journeys through a finished scene share: making it takes a minute."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from flows.server import prefect_server
from flows.settings import local_environment


@pytest.fixture(scope="session", autouse=True)
def as_a_user(own_environment: None) -> None:
    """Start every program of a journey in the environment of a user."""


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
def home(small_town: tuple[Path, dict[str, Any]]) -> Path:
    """Return the home of the journeys through the small town."""
    return small_town[0]


@pytest.fixture(scope="session")
def first(small_town: tuple[Path, dict[str, Any]]) -> dict[str, Any]:
    """Return what the first run of the small town told."""
    return small_town[1]
