"""What a store at an S3 service costs beside a local folder: the same run in both, step by step in turns."""

from __future__ import annotations

import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from aug3d_core.bench.figure import Figure, at_most
from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, walk
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.store.traffic import Traffic
from aug3d_core.studies.common.trial import Measured, Say, directly

_MIB = 2**20


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Make the town in a local folder and in a shared store, then see what it costs another machine that finds all made.

    The shared store is that of AUG3D_STORE, in a place of its own that is deleted; without one, moto's server on this machine.
    """
    for name in ("local", "shared", "cold"):
        shutil.rmtree(store.root / name, ignore_errors=True)
    with _service() as url:
        local, shared = _opened(store, "local", ""), _opened(store, "shared", url)
        try:
            seconds, records, asked = _in_turns(local, shared, scene, say)
            cold = _opened(store, "cold", url)
            found = _looked_up(cold, scene, say)
            again = _looked_up(cold, scene, say)
        finally:
            assert shared.shared is not None
            shared.shared.bucket.delete(shared.shared.bucket.names(""))
    objects = len(records)
    files = sum(len(record.files) for record in records)
    return {
        "s3_over_local_ratio": at_most(1.1, seconds["shared"] / seconds["local"], "of the time"),
        "s3_requests_per_object": Figure(sum(asked.requests.values()) / objects, "requests"),
        **{f"s3_{kind}_per_object": Figure(n / objects, "requests") for kind, n in sorted(asked.requests.items())},
        "s3_objects": Figure(objects, "objects"),
        "s3_files_per_object": Figure(files / objects, "files"),
        "s3_up": Figure(asked.bytes_up / _MIB, "MiB"),
        "s3_cold_requests_per_object": Figure(sum(found.requests.values()) / objects, "requests"),
        "s3_cold_down": Figure(found.bytes_down / _MIB, "MiB"),
        "s3_warm_requests": Figure(sum(again.requests.values()), "requests"),
        "s3_warm_down": at_most(0.0, again.bytes_down / _MIB, "MiB"),
        "local_seconds": Figure(seconds["local"], "s"),
        "shared_seconds": Figure(seconds["shared"], "s"),
    }


def _in_turns(
    local: Store, shared: Store, scene: Measured, say: Say
) -> tuple[Mapping[str, float], list[Record], Traffic]:
    """Make each step in one store and then in the other, the order changing; return seconds, what was made, and traffic."""
    walks = {"local": _walk(local, scene, say), "shared": _walk(shared, scene, say)}
    seconds, records, before = dict.fromkeys(walks, 0.0), [], shared.traffic()
    order, ended = list(walks), False
    while not ended:
        for name in order:
            started = time.monotonic()
            visit = next(walks[name], None)
            seconds[name] += time.monotonic() - started
            ended = visit is None
            if visit and visit.record and name == "shared":
                records.append(visit.record)
        order.reverse()
    return seconds, records, shared.traffic().since(before)


def _looked_up(store: Store, scene: Measured, say: Say) -> Traffic:
    """Return what a run asks of the shared store that has all of it."""
    before = store.traffic()
    for visit in _walk(store, scene, say):
        assert visit.cached
    return store.traffic().since(before)


def _walk(store: Store, scene: Measured, say: Say) -> Iterator[Visit]:
    material = Material()
    return walk(store, material.stages(), scene.config(), material, directly(store, say))


def _opened(store: Store, name: str, url: str) -> Store:
    """Return a store of its own below another's folder, with or without a shared one."""
    before = os.environ.pop(SHARED_VARIABLE, None)
    try:
        os.environ |= {SHARED_VARIABLE: url} if url else {}
        return Store(store.root / name)
    finally:
        os.environ.pop(SHARED_VARIABLE, None)
        os.environ |= {SHARED_VARIABLE: before} if before else {}


@contextmanager
def _service() -> Iterator[str]:
    """Yield a place in the store of the user, or in one that runs as long as this."""
    if url := os.environ.get(SHARED_VARIABLE, "").strip():
        yield f"{url.rstrip('/')}/bench-{secrets.token_hex(4)}"
        return
    with s3_service() as address:
        mine = {**KEYS, "AWS_ENDPOINT_URL": address}
        before = {name: os.environ.get(name) for name in mine}
        try:
            os.environ |= mine
            yield f"s3://{BUCKET}/town"
        finally:
            for name, value in before.items():
                os.environ.pop(name, None)
                os.environ |= {name: value} if value is not None else {}
