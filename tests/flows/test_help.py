"""The help pages say all that stands in the help texts, units in brackets too."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from flows.cli import app

_WIDE = {"COLUMNS": "4000", "TERMINAL_WIDTH": "4000"}  # no text is broken into lines


def pages(command: Any, *words: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    yield words, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from pages(inner, *words, name)


PAGES = dict(pages(typer.main.get_command(app)))


def letters(text: str) -> str:
    return re.sub(r"[\s`*\u2500-\u257f]", "", text)


@pytest.mark.parametrize("words", PAGES, ids=" ".join)
def test_no_word_of_a_help_text_is_lost(words: tuple[str, ...]) -> None:
    command = PAGES[words]
    shown = letters(CliRunner().invoke(app, [*words, "--help"], env=_WIDE).output)
    for text in (command.help, *(getattr(parameter, "help", None) for parameter in command.params)):
        assert letters(text or "") in shown
