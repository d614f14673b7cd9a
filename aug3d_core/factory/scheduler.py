"""The scheduler of a Dask cluster that AUG3D_DASK names: whether it may be used, and who works for it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from urllib.parse import urlsplit

from aug3d_core.run.errors import UsageError
from aug3d_core.store.layout import SHARED_VARIABLE

DASK = "AUG3D_DASK"
CONNECT_S = 20
_LOOPBACK = ("localhost", "127.0.0.1", "::1")


def scheduler_from(environment: Mapping[str, str]) -> str:
    """Return the address of the scheduler, "" if none is named; raises UsageError if it cannot be used."""
    address = environment.get(DASK, "").strip()
    if not address:
        return ""
    try:
        parts = urlsplit(address)
        known = parts.scheme in ("tcp", "tls") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        known = False
    if not known:
        raise UsageError(f"{DASK} is {address!r}", "give the address of a Dask scheduler, e.g. tls://scheduler:8786")
    if parts.scheme == "tcp" and parts.hostname not in _LOOPBACK:
        raise UsageError(
            f"{DASK} is {address}: whoever reaches a Dask scheduler without TLS can run anything on its workers",
            "give it a certificate and name it as tls://HOST:PORT (see docs.dask.org, TLS), or reach it through an SSH tunnel",
        )
    if not environment.get(SHARED_VARIABLE, "").strip():
        raise UsageError(
            f"{DASK} is set, but {SHARED_VARIABLE} is not", "Dask's workers hand over through a shared store"
        )
    if find_spec("distributed") is None:
        raise UsageError(f"{DASK} is set, but Dask is not installed", "pip install 'aug3d[dask]'")
    return address


def worker_count(address: str) -> int:
    """Return how many workers a scheduler has; raises UsageError if it does not answer."""
    from distributed import Client

    try:
        with Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            return len(client.scheduler_info(n_workers=-1)["workers"])
    except (OSError, TimeoutError, RuntimeError) as error:
        raise UsageError(
            f"no Dask scheduler answers at {address}: {error}", f"start it, or leave {DASK} out"
        ) from error
