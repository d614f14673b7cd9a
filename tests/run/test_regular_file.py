"""Only regular files are opened, and none is waited for."""

from __future__ import annotations

import gc
import os
import socket
from pathlib import Path

import pytest

from aug3d_core.run.digest import file_digest
from aug3d_core.run.regular_file import IrregularFileError, content, json_content, opened


def test_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"content")
    (tmp_path / "link").symlink_to(tmp_path / "a")
    with opened(tmp_path / "link") as file:
        assert file.read() == b"content"
    assert content(tmp_path / "a", 7) == b"content"


@pytest.mark.parametrize("kind", ["pipe", "device", "endless", "socket", "folder"])
def test_anything_else_is_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / kind
    held = None
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        held = socket.socket(socket.AF_UNIX)
        held.bind(str(path))
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/null" if kind == "device" else "/dev/zero")
    gc.collect()  # or what earlier tests left open is closed in between
    before = len(list(Path("/proc/self/fd").iterdir()))
    for read in (opened, content, json_content, file_digest):
        with pytest.raises(OSError):
            read(path)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    if held:
        held.close()


def test_an_endless_device_is_named(tmp_path: Path) -> None:
    with pytest.raises(IrregularFileError, match="no file but a pipe, a socket or a device: '/dev/zero'"):
        content(Path("/dev/zero"))


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "a").open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(OSError, match="larger than 512 MiB"):
        json_content(tmp_path / "a")


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "", '{"a": 1} x', "1" * 5000 + "x"])
def test_bad_json_is_one_kind_of_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "a").write_text(text)
    with pytest.raises(ValueError):
        json_content(tmp_path / "a")


def test_numbers_that_no_float_holds_are_infinite(tmp_path: Path) -> None:
    (tmp_path / "a").write_text(f"[{'9' * 400}, {'9' * 5000}, 12, 1e400]")
    assert json_content(tmp_path / "a") == [float("inf"), float("inf"), 12, float("inf")]
