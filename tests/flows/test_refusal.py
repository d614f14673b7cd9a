"""A full disk leaves a command with one typed error, whichever library met it."""

import errno
import json
import os
import sqlite3

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
