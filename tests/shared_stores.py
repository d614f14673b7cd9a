"""The suites that hold for the folder of one machine hold for what several share: each runs twice."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import pytest

from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service

_number = count()


@pytest.fixture(scope="session")
def s3() -> Iterator[str]:
    """Return the address of an S3 service."""
    with s3_service() as address:
        yield address


@pytest.fixture
def bucket(s3: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the address of an empty place in a bucket, which this process may use."""
    for name, value in {**KEYS, "AWS_ENDPOINT_URL": s3}.items():
        monkeypatch.setenv(name, value)
    return f"s3://{BUCKET}/{next(_number)}"


@pytest.fixture
def shared(bucket: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """Let the stores of this process share that place."""
    monkeypatch.setenv("AUG3D_STORE", bucket)
    return bucket


@pytest.fixture(params=["folder", "bucket"])
def either(request: pytest.FixtureRequest) -> None:
    """Run a test twice: with the folder of one machine, and with a store that several share."""
    if request.param == "bucket":
        request.getfixturevalue("shared")
