"""The help pages say all that stands in the help texts, units in brackets too."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from flows.cli import app
from flows.options import DEFAULT_HOME
from flows.settings import HOME_VARIABLE

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


def options(name: str) -> list[Any]:
    return [one for page in PAGES.values() for one in page.params if name in one.opts]


@pytest.mark.parametrize("name", ["--home", "--json"])
def test_an_option_of_many_commands_has_one_text(name: str) -> None:
    """A text of its own says what is so in one command alone."""
    often = Counter(option.help for option in options(name))
    assert len([text for text, count in often.items() if count > 1]) == 1, often


def test_the_home_is_found_the_same_way_by_all_commands() -> None:
    assert {(option.envvar, option.default) for option in options("--home")} == {(HOME_VARIABLE, DEFAULT_HOME)}
