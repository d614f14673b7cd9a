"""`aug3d open`: the report of a scene in the browser, or where it is on a machine that has no screen."""

from __future__ import annotations

import json
import os
import sys
import webbrowser
from typing import Annotated

import typer
from rich.console import Console

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.scenes import bring_report
from aug3d_core.store.version_name import find_version
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.reading import read_store
from flows.refusal import typed_errors

_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")  # one of them is set where a browser can show a page


def open_report(
    scene: Annotated[
        str,
        typer.Argument(help="SCENE (its newest version), SCENE@published, or SCENE@2026-11-21, as in aug3d compare."),
    ],
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Open the newest report of a scene in the browser. Without a screen, say where it is."""
    with typed_errors(as_json, home):
        store = read_store(home)
        version = find_version(store, scene)
        bring_report(store, version)
        report = (version / layout.REPORT).resolve()
        if not report.is_file():
            raise StoreError(f"{report} is missing", "run the scene again: the report is written anew")
        shown = has_screen() and webbrowser.open(report.as_uri())
        if as_json:
            print(json.dumps({"report": str(report), "opened": shown}))
        else:
            said = "" if shown else "   (no browser here: copy the file to where there is one)"
            Console().print(f"report  {report}{said}", highlight=False, soft_wrap=True, markup=False)


def has_screen() -> bool:
    """Say whether a browser with a window can be opened: text browsers, which would take the terminal, do not count."""
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in _SCREENS)
