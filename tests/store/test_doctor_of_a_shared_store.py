"""`aug3d doctor` tries a shared store: one that keeps what sharing rests on passes, others are told why not."""

from __future__ import annotations

import obstore
import pytest

from aug3d_core import doctor
from aug3d_core.store.bucket import Bucket


def test_a_service_that_keeps_conditional_writes_is_ok_and_left_as_it_was(shared: str) -> None:
    found = doctor._shared_store()
    assert found.state == "ok" and shared in found.found
    assert Bucket(shared).names("") == []


def test_a_service_that_ignores_conditions_is_refused(shared: str, monkeypatch: pytest.MonkeyPatch) -> None:
    put = obstore.put
    monkeypatch.setattr(obstore, "put", lambda service, name, content, **_: put(service, name, content))
    found = doctor._shared_store()
    assert found.state == "fail" and "If-None-Match" in found.found


def test_a_bucket_that_is_not_there_is_named(shared: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AUG3D_STORE", "s3://no-such-bucket/x")
    found = doctor._shared_store()
    assert found.state == "fail" and "s3://no-such-bucket/x" in found.found and found.remedy
