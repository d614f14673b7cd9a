"""A full disk leaves a command with one typed error, whichever library met it."""

import errno
import json
import os
import sqlite3
from pathlib import Path

import pytest
import typer
from sqlalchemy.exc import OperationalError

from flows.refusal import typed_errors

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/nowhere/report.html")
SQLITE = sqlite3.OperationalError("database or disk is full")


@pytest.mark.parametrize(
    "error",
    [
        FULL,
        OSError(errno.EDQUOT, os.strerror(errno.EDQUOT), "/nowhere/report.html"),
        SQLITE,
        OperationalError("INSERT", {}, SQLITE),
        ExceptionGroup("two", [ValueError("x"), FULL]),
    ],
)
def test_a_full_disk_is_one_typed_error_and_json_is_printed(error: Exception, capsys) -> None:
    with pytest.raises(typer.Exit) as left, typed_errors(as_json=True):
        raise error
    told = json.loads(capsys.readouterr().out)
    assert left.value.exit_code == 1
    assert "no space left" in told["failure"]["problem"] and "free some space" in told["failure"]["remedy"]


def test_the_file_and_what_is_free_are_named(capsys) -> None:
    with pytest.raises(typer.Exit), typed_errors(as_json=False):
        raise FULL
    told = capsys.readouterr().err
    assert "/nowhere/report.html" in told and "MiB free" in told


def test_a_file_on_another_disk_than_the_homes_is_what_has_no_room(tmp_path: Path, capsys) -> None:
    for home, says_home in ((tmp_path / "home", False), (tmp_path, True)):
        full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "out" / "report.html"))
        with pytest.raises(typer.Exit), typed_errors(as_json=True, home=home):
            raise full
        failure = json.loads(capsys.readouterr().out)["failure"]
        named = tmp_path if says_home else tmp_path / "out" / "report.html"
        assert failure["problem"].startswith(f"no space left on the disk of {named}:")
        assert ("--home" in failure["remedy"]) == says_home


def test_another_error_is_not_called_a_full_disk() -> None:
    with pytest.raises(ValueError, match="no such thing"), typed_errors(as_json=True):
        raise ValueError("no such thing")


def test_what_a_server_adds_about_http_is_left_out(capsys) -> None:
    server = RuntimeError("Server error '500 Internal Server Error'\nFor more information check: https://example.org")
    server.__cause__ = FULL
    with pytest.raises(typer.Exit), typed_errors(as_json=True):
        raise server
    problem = json.loads(capsys.readouterr().out)["failure"]["problem"]
    assert problem.endswith("500 Internal Server Error'")


@pytest.mark.parametrize(
    ("number", "says"),
    [
        (errno.EACCES, "let this user"),
        (errno.EPERM, "let this user"),
        (errno.EROFS, "a disk that can be written"),
        (errno.ENOENT, "nothing is there"),
        (errno.EISDIR, "this is a folder"),
        (errno.ENOTDIR, "is a file, not a folder"),
    ],
)
def test_a_path_that_cannot_be_used_is_named_with_what_to_do(number: int, says: str, capsys) -> None:
    with pytest.raises(typer.Exit) as left, typed_errors(as_json=True):
        raise OSError(number, os.strerror(number), "/data/photos [raw]")
    failure = json.loads(capsys.readouterr().out)["failure"]
    assert left.value.exit_code == 1 and says in failure["remedy"]
    assert failure["problem"] == f"/data/photos [raw]: {os.strerror(number)}"


@pytest.mark.parametrize("error", [OSError(errno.ECONNRESET, "reset", "x"), FileNotFoundError("of no file")])
def test_other_errors_of_the_system_are_raised(error: OSError) -> None:
    with pytest.raises(OSError), typed_errors(as_json=True):
        raise error


@pytest.mark.parametrize("goes_on", [True, False])
def test_ctrl_c_says_that_it_goes_on_only_where_it_does(goes_on: bool, capsys) -> None:
    with pytest.raises(typer.Exit) as left, typed_errors(as_json=False, goes_on=goes_on):
        raise KeyboardInterrupt
    told = capsys.readouterr().err
    assert left.value.exit_code == 130 and told.startswith("stopped")
    assert ("go on where it was" in told) == goes_on
