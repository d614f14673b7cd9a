"""The worker tells MLflow, between runs, what it could not be told."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

import pytest

from aug3d_core.store.store import Store
from tasks.mlflow_outbox import Entry, put, waiting
from tests.tasks.logged import version


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_it_tells_mlflow_what_waits(tmp_path: Path, fresh_mlflow: Path) -> None:
    from flows.worker import tell_mlflow

    store = Store(tmp_path)
    shutil.copy(fresh_mlflow, tmp_path)
    put(store, Entry(scene="town", version=version(tmp_path).name))

    async def until_told() -> None:
        telling = asyncio.create_task(tell_mlflow(store))
        while waiting(store):
            await asyncio.sleep(0.05)
        telling.cancel()

    asyncio.run(asyncio.wait_for(until_told(), 60))
