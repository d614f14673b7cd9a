"""How much room tables have."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from flows.words import widened


@pytest.mark.parametrize(("terminal", "width", "wanted"), [(False, 80, 140), (False, 200, 200), (True, 80, 80)])
def test_only_what_is_no_terminal_is_widened(terminal: bool, width: int, wanted: int) -> None:
    console = Console(file=io.StringIO(), width=width, force_terminal=terminal)
    assert widened(console) is console and console.width == wanted
