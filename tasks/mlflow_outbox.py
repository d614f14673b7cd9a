"""What MLflow is still to be told: a small file per version, written before MLflow is asked and deleted after it agreed.

An entry holds no figures: those are in the version's `metrics.json` and in the records that it names.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock
from pydantic import ValidationError

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.stage import Frozen
from aug3d_core.store import layout
from aug3d_core.store.store import Store

_TURN_S = 60.0  # how long another process may be telling MLflow before this one leaves it to the next


class Entry(Frozen):
    """A version of a scene to log, and whether its model is then the published one."""

    scene: str
    version: str
    publish: bool = False


def put(store: Store, entry: Entry) -> None:
    """Add an entry; it survives a kill from then on."""
    folder = store.root / layout.MLFLOW_OUTBOX
    folder.mkdir(exist_ok=True)
    name = f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S.%f} {entry.scene}.json"
    write_synced(folder / name, entry.model_dump_json().encode())


def waiting(store: Store) -> list[tuple[Path, Entry]]:
    """Return the entries with their files, oldest first; a file that is no entry is passed over."""
    found = []
    for file in sorted((store.root / layout.MLFLOW_OUTBOX).glob("[!.]*.json")):
        with suppress(FileNotFoundError, ValidationError):
            found.append((file, Entry.model_validate_json(file.read_bytes())))
    return found


@contextmanager
def my_turn(store: Store) -> Iterator[None]:
    """Hold the right to tell MLflow what is waiting; raises filelock.Timeout while another process does it."""
    with FileLock(store.root / layout.LOCKS / f"{layout.MLFLOW_OUTBOX}.lock", timeout=_TURN_S):
        yield
