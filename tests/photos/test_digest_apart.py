"""The digest of a folder comes from a process of its own: the caller opens no photograph."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from aug3d_core.factory.material import given_photos
from aug3d_core.photos import digest_apart
from aug3d_core.photos.discover import folder_digest
from aug3d_core.run.errors import InputError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "-photos ?#[1]"
    folder.mkdir()
    for name in ("a.jpg", "\udcff.png"):  # a name need not be UTF-8
        (folder / name).write_bytes(name.encode(errors="surrogateescape"))
    return folder


def test_it_is_the_digest_and_the_caller_opens_no_photograph(folder: Path) -> None:
    opened: list[str] = []
    listening = True
    sys.addaudithook(lambda event, given: opened.append(str(given[0])) if listening and event == "open" else None)
    found = given_photos(folder).digest
    assert not [path for path in opened if Path(path).parent == folder]
    folder_digest(folder)
    assert [path for path in opened if Path(path).parent == folder], "or nothing was heard at all"
    listening = False
    assert found == folder_digest(folder)


def test_a_folder_that_is_none_and_a_reader_that_was_killed_are_told(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="does not exist"):
        digest_apart.digest_apart(tmp_path / "none")
    monkeypatch.setattr(digest_apart.sys, "executable", "/bin/false")
    with pytest.raises(InputError, match="could not be read: its reader ended with exit code 1"):
        digest_apart.digest_apart(folder)
