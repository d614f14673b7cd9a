"""Train a collection: the flow that the command line, a schedule or a user of the Prefect UI starts."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from prefect import flow
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.collections import page
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.collections.flights import overlapping
from aug3d_core.collections.made import MadeCollection, make_collection, step_count
from aug3d_core.collections.versions import collection_metrics, held_back
from aug3d_core.scene_files import read_each
from aug3d_core.store import layout
from aug3d_core.store.code_version import code_version
from aug3d_core.store.published import publish, published
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import bring_report, new_version, share_version, version_metrics, versions, write_metrics
from aug3d_core.store.store import Store
from flows.photographs import material_of
from flows.regenerate import NOT_PUBLISHED, PUBLISHED, UNCHANGED
from flows.settings import home
from tasks.build_task import through_prefect
from tasks.collections import log_collection
from tasks.progress import reporter
from tasks.run_locks import run_lock


@flow(name="collection", flow_run_name="{collection}")
def train_collection(
    collection: Annotated[str, Field(description="A collection; see aug3d collections list.")],
) -> State:
    """Make the scenes of a collection where something changed, train one model on them, and judge it on each.

    A scene that fails does not stop the others. The model is published unless a scene is worse than in the published version.
    Where nothing changed since the newest version no other is written: that one is judged again.
    """
    store = Store(home())
    with run_lock(store.root), store.using():
        return _train(store, collection, COLLECTIONS.read(store, collection))


def _train(store: Store, name: str, entry: CollectionEntry) -> State:
    started, done, total = time.monotonic(), 0, step_count(entry)

    def say(what: str) -> None:
        nonlocal done
        done += 1
        reporter("collection")(done, max(total, done), what)

    made = make_collection(
        store, entry, read_each(store), lambda of: through_prefect(store, of), say, partial(material_of, store)
    )
    assert made.training
    newest, last = versions(store, name, layout.COLLECTIONS)[-1:], published(store, name, layout.COLLECTIONS)
    if newest and version_metrics(newest[0])["objects"] == [list(item) for item in made.objects]:
        version = newest[0]
    else:
        version = _written(store, name, made, time.monotonic() - started)
    metrics, told = version_metrics(version), version / layout.TOLD
    against = held_back(metrics, version_metrics(last) if last else None, entry.publish.most_psnr_drop_db)
    publishes = version != last and not against
    if publishes:
        told.unlink(missing_ok=True)  # MLflow is to know that, too
    ending = ""
    if not told.exists():
        share_version(store, version, made.objects)
        if publishes:
            publish(store, version)
        ending = _told(store, version, made.training, published=not against)
    if version == last:
        return Completed(name=UNCHANGED, message=f"nothing changed since {last.name}, which is published{ending}")
    if against:
        return Failed(name=NOT_PUBLISHED, message=f"{version.name} is not published: {against}{ending}")
    return Completed(name=PUBLISHED, message=f"{version.name} is published: {_reached(metrics)}{ending}")


def _written(store: Store, name: str, made: MadeCollection, seconds: float) -> Path:
    """Write a version of what was made; return its folder."""
    metrics = collection_metrics(name, made, overlapping(store, made.members), code_version(), seconds)
    version = new_version(store, name, layout.COLLECTIONS)
    page.write(store, metrics, made, version / layout.REPORT)
    write_metrics(version, metrics)
    return version


def _told(store: Store, version: Path, training: Record, published: bool) -> str:
    """Log a version to MLflow, and mark it so; returns what to add to a message where MLflow could not be used."""
    bring_report(store, version)  # another machine may have made it
    if why := log_collection(store, version, training, published):
        return f"; {why}: the next training logs it"
    (version / layout.TOLD).touch()
    return ""


def _reached(metrics: Mapping[str, Any]) -> str:
    return ", ".join(f"{data} {told['test_psnr_mean']:.2f} dB" for data, told in metrics["tests"].items())
