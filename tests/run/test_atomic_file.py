"""A file that is replaced is old or whole, whenever the power goes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aug3d_core.run.atomic_file import replacing


def test_the_bytes_are_on_the_disk_before_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, part, order = tmp_path / "a", tmp_path / "a.part", []
    fsync, replace = os.fsync, Path.replace

    def synced(handle: int) -> None:
        order.append(("synced", part.read_bytes()))
        fsync(handle)

    def renamed(old: Path, new: Path) -> Path:
        order.append(("renamed", old.read_bytes()))
        return replace(old, new)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    with replacing(path, part) as file:
        file.write(b"whole")
    assert order == [("synced", b"whole"), ("renamed", b"whole")]
    assert path.read_bytes() == b"whole" and not part.exists()


def test_what_fails_half_way_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path, tmp_path / "a.part") as file:
        file.write(b"new")
        raise RuntimeError
    assert path.read_text() == "old"
