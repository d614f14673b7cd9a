"""A scheduler is used where nobody else can reach it, or by TLS, and where there is a store to hand over through."""

from __future__ import annotations

import pytest

from aug3d_core.factory.scheduler import DASK, scheduler_from
from aug3d_core.run.errors import UsageError
from aug3d_core.store.layout import SHARED_VARIABLE


@pytest.mark.parametrize(
    "address", ["scheduler", "http://127.0.0.1:8786", "tcp://127.0.0.1", "tls://:8786", "tcp://[::1:8786"]
)
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match=DASK):
        scheduler_from({DASK: address, SHARED_VARIABLE: "s3://bucket"})


def test_an_open_scheduler_is_used_on_this_machine_only() -> None:
    shared = {SHARED_VARIABLE: "s3://bucket"}
    with pytest.raises(UsageError, match="without TLS"):
        scheduler_from({DASK: "tcp://10.0.0.7:8786", **shared})
    for address in ("tls://10.0.0.7:8786", "tcp://127.0.0.1:8786", "tcp://[::1]:8786"):
        assert scheduler_from({DASK: address, **shared}) == address


def test_without_a_shared_store_there_is_nothing_to_hand_over_through() -> None:
    assert scheduler_from({}) == scheduler_from({DASK: " "}) == ""
    with pytest.raises(UsageError, match=SHARED_VARIABLE):
        scheduler_from({DASK: "tcp://127.0.0.1:8786"})
