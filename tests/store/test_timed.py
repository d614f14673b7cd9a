"""Folders named by the time are nobody else's, and sort."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from aug3d_core.store.timed import timed_folder


def test_each_has_a_folder_of_its_own_however_many_ask_at_once(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: timed_folder(tmp_path / "of" / "demo", "tradeoff-"), range(64)))
    assert len(set(found)) == 64 and all(folder.is_dir() and folder.name.startswith("tradeoff-") for folder in found)
    assert sorted(one := [timed_folder(tmp_path).name for _ in range(5)]) == one
