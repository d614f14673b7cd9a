"""Runs of several machines on one store: what is made already costs the next machine what its report reads, and no more."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aug3d_core.bench.s3_service import KEYS
from aug3d_core.factory.config import scene_config
from aug3d_core.report.reads import read_of
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.record import read_record
from flows.cli import app
from tests.flows.stand_in import Stages, stand_in

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]


@pytest.fixture
def stages(fresh_mlflow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stages:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"a photograph")
    return stand_in(monkeypatch, fresh_mlflow, tmp_path)


def run(home: Path) -> dict[str, Any]:
    from flows.factory import factory

    photos, config = home.parent / "photos", scene_config("tiny").model_copy(update={"auto": ()})
    return factory("little", str(photos), "tiny", config, str(home))


def test_a_cold_machine_brings_what_the_report_reads_and_a_warm_one_nothing(
    stages: Stages, tmp_path: Path, shared: str
) -> None:
    made, home = run(tmp_path / "maker"), tmp_path / "cold"
    assert made["shared_store"]["mib_down"] == 0 and made["shared_store"]["requests"]["put"] > len(stages.computed)
    stages.computed.clear()
    cold = run(home)
    assert stages.computed == [] and cold["shared_store"]["mib_down"] > 0
    for file in home.glob("objects/*/*/record.json"):
        record = read_record(file)
        here = {path.relative_to(file.parent / "files").as_posix() for path in file.parent.rglob("files/**/*")}
        assert here == set(read_of(record)) < set(record.files) or not here, record.stage
    warm = run(home)
    assert warm["shared_store"]["mib_down"] == 0 and set(warm["shared_store"]["requests"]) <= {"list", "get", "head"}

    shown = CliRunner().invoke(app, ["show", "little", "--home", str(tmp_path / "third"), "--json"])
    told = json.loads(shown.stdout)
    assert told["shared_store"] == warm["shared_store"] and Path(told["paths"]["report"]).is_file()
    assert str(tmp_path / "third") in told["paths"]["objects"]["photos"]
    text = CliRunner().invoke(app, ["show", "little", "--home", str(tmp_path / "third")]).output
    assert "MiB up, 0.0 MiB down" in text

    place = Bucket(shared)
    everything = [place.get(name) or b"" for name in place.names("")]
    everything += [path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()]
    for secret in (KEYS["AWS_SECRET_ACCESS_KEY"], KEYS["AWS_ACCESS_KEY_ID"]):
        assert not [content for content in everything if secret.encode() in content]
