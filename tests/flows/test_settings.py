"""What a process of ours sets before Prefect and MLflow are imported."""

from __future__ import annotations

import os
from urllib.request import getproxies, proxy_bypass

import pytest

from flows.settings import reach_this_machine_directly


@pytest.fixture(autouse=True)
def no_proxies(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "https_proxy", "all_proxy", "no_proxy"):
        for spelt in (name, name.upper()):
            monkeypatch.setenv(spelt, "")  # what is set meanwhile goes, too
            monkeypatch.delenv(spelt)


@pytest.mark.parametrize("excepted", ["", "NO_PROXY", "no_proxy"])
def test_this_machine_is_reached_past_a_proxy_and_others_as_before(
    excepted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("http_proxy", "http://proxy.example:3128")
    if excepted:
        monkeypatch.setenv(excepted, "files.example, .local")
    reach_this_machine_directly()
    assert getproxies()["http"] == "http://proxy.example:3128"
    assert all(map(proxy_bypass, ("127.0.0.1", "localhost")))
    assert bool(proxy_bypass("files.example")) == bool(excepted) and not proxy_bypass("pypi.example")


def test_without_a_proxy_nothing_is_set() -> None:
    reach_this_machine_directly()
    assert "no_proxy" not in os.environ and "NO_PROXY" not in os.environ
