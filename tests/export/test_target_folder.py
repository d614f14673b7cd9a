"""A folder that an export could not fill is as it was before, and a full disk is named, whichever library met it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from aug3d_core.export.target_folder import filling
from aug3d_core.run import full_disk
from aug3d_core.run.errors import DiskFull, StoreError, UsageError


def fill(folder: Path, error: BaseException | None = None) -> None:
    """Write a file and a folder, then fail."""
    with filling(folder):
        (folder / "more").mkdir(parents=True)
        (folder / "part").write_bytes(b"begun")
        if error:
            raise error


@pytest.mark.parametrize("error", [ValueError("a bug"), KeyboardInterrupt(), StoreError("damaged", "run it again")])
def test_a_failure_leaves_the_folder_as_it_was_and_is_told_as_it_is(error: BaseException, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty"):
        with pytest.raises(type(error)) as told:
            fill(tmp_path / name, error)
        assert told.value is error
    assert list(tmp_path.rglob("*")) == [tmp_path / "empty"]
    fill(tmp_path / "new")
    assert (tmp_path / "new" / "part").is_file() and (tmp_path / "new" / "more").is_dir()


def test_what_was_there_before_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(UsageError, match="not an empty folder"):
        fill(tmp_path)
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize("error", [RuntimeError("Failed to call seek"), SystemError("Unknown GDAL Error"), OSError()])
def test_an_error_without_the_systems_words_is_the_full_disks_where_it_is_full(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "out"
    monkeypatch.setattr(full_disk, "free_bytes", lambda of: 2**20 if (of / "part").exists() else 2**30)
    with pytest.raises(DiskFull) as told:
        fill(folder, error)
    assert told.value.problem == f"no space left on the disk of {folder}: {str(error) or type(error).__name__}"
    assert "now 1 MiB free" in told.value.remedy and "another disk" in told.value.remedy
    assert not folder.exists()


def test_the_systems_words_are_enough(tmp_path: Path) -> None:
    with pytest.raises(DiskFull, match=str(tmp_path / "out")):
        fill(tmp_path / "out", OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)))


def test_an_error_that_says_what_to_do_is_told_on_a_full_disk_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(full_disk, "free_bytes", lambda of: 0)
    with pytest.raises(StoreError, match="damaged"):
        fill(tmp_path / "out", StoreError("damaged", "run it again"))
