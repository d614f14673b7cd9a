"""The home of a machine as a cache: of what the shared store has, it keeps what was used last, within a bound."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.shared import Shared
from aug3d_core.store.usage import bytes_under


def trim(root: Path, shared: Shared, most_bytes: float) -> int:
    """Delete files of objects, the least recently used first, until those that the shared store has too fit into the bound.

    Only for whoever holds the right to drop objects. Records stay: what is read again is brought again, and compared with
    its digest. Returns how many bytes went. Raises StoreError as the shared store does.
    """
    folders = [file.parent for file in (root / layout.OBJECTS).glob(f"*/[!.]*/{layout.RECORD}")]
    used = {folder: shared.used_ns(folder) for folder in folders if shared.is_shared(folder)}
    sizes = {folder: bytes_under(folder / FILES) for folder in used}
    held, gone = sum(sizes.values()), 0
    for folder in sorted(used, key=lambda folder: used[folder]):
        if held - gone <= most_bytes:
            break
        if sizes[folder] and shared.holds(folder.parent.name, folder.name, (folder / layout.RECORD).read_bytes()):
            _drop(folder)
            gone += sizes[folder]
    return gone


def _drop(folder: Path) -> None:
    """Delete an object's files: out of sight first, since a deletion may be cut short."""
    out_of_sight = folder.with_name(f"{layout.GONE}{folder.name}-{os.getpid()}")
    (folder / FILES).rename(out_of_sight)
    shutil.rmtree(out_of_sight)
