"""Two machines with homes of their own and one store at an S3 service: nothing is made twice, and a dead one's work goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.report.reads import read_of
from aug3d_core.run.files import FILES
from aug3d_core.store.record import read_record
from tests.journeys.test_demo import command, computed, digests, run
from tests.store.s3_service import KEYS, s3_service

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]


@pytest.fixture(scope="module")
def team(served: dict[str, str]) -> Iterator[dict[str, str]]:
    """Return the environment of every machine of a team."""
    with s3_service() as address:
        yield {**served, **KEYS, "AWS_ENDPOINT_URL": address, "AUG3D_STORE": "s3://photographs/team"}


def test_a_machine_dies_another_goes_on_and_a_third_has_nothing_to_do(
    first: dict[str, Any], tmp_path: Path, team: dict[str, str]
) -> None:
    homes = [tmp_path / name for name in ("one", "two", "three")]
    dying = subprocess.Popen(
        command(homes[0]), env=team, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    shards = homes[0] / "work" / "depth"
    while dying.poll() is None and len([*shards.glob("*/files/raw/*.planes")]) < 4:
        time.sleep(0.1)
    assert dying.poll() is None, "it ended before depth"
    os.killpg(dying.pid, signal.SIGKILL)
    dying.wait()

    second = run(homes[1], env=team)
    assert digests(second) == digests(first)
    begun = [stage.name for stage in FROM_TOWN]
    assert computed(second) == set(begun[begun.index("depth") :])

    third = run(homes[2], env=team)
    assert computed(third) == set() and digests(third) == digests(first)
    assert third["shared_store"]["mib_down"] > 0, "what the report reads, and the model for its own MLflow"
    for file in homes[2].glob("objects/*/*/record.json"):
        record, files = read_record(file), file.parent / FILES
        here = {path.relative_to(files).as_posix() for path in files.rglob("*") if path.is_file()}
        assert here <= {*read_of(record), MODEL_WEIGHTS, MODEL_CONFIG}, record.stage
    assert not [path for home in homes for path in home.rglob("*") if path.is_file() and holds_a_key(path)]


def holds_a_key(path: Path) -> bool:
    return KEYS["AWS_SECRET_ACCESS_KEY"].encode() in path.read_bytes()
