"""The same work in a local folder and in a shared store: what is counted, and that nothing of it is left."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from aug3d_core.bench import machines
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from tests.store.little_store import add_object

KEYS = ("a", "b", "c")


@pytest.fixture(autouse=True)
def little_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a run make three objects of two files, one of which all have."""

    def walk(store: Store, *_: object) -> Iterator[SimpleNamespace]:
        for key in KEYS:
            found = store.find("sfm", key)
            yield SimpleNamespace(record=found or add_object(store, "sfm", key, 2**20), cached=bool(found))

    monkeypatch.setattr(machines, "_walk", walk)


def figures(home: Path) -> dict[str, float | None]:
    told = machines.figures(Store(home), Measured("tiny"), lambda *_: None)
    return {name: figure.value for name, figure in told.items()}


def test_what_was_asked_is_told_per_object_and_nothing_is_left(tmp_path: Path, shared: str) -> None:
    told = figures(tmp_path)
    assert told["s3_objects"] == 3 and told["s3_files_per_object"] == 2
    assert told["s3_head_per_object"] == 2 and told["s3_put_per_object"] == pytest.approx((3 + 1 + 3) / 3)
    assert told["s3_up"] == pytest.approx(1.0, abs=0.01), "what all have goes up once"
    assert told["s3_cold_requests_per_object"] == 2 and 0 < (told["s3_cold_down"] or 0) < 0.01
    assert told["s3_warm_requests"] == told["s3_warm_down"] == 0
    assert Bucket(shared).names("") == [] and os.environ["AUG3D_STORE"] == shared


def test_without_a_store_one_runs_as_long_as_the_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("AUG3D_STORE", "AWS_ENDPOINT_URL", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")
    for name in names:
        monkeypatch.delenv(name, raising=False)
    assert figures(tmp_path)["s3_objects"] == 3
    assert not {*names} & {*os.environ}
