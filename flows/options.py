"""Options that many commands have, and mean the same by."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.settings import HOME_VARIABLE

DEFAULT_HOME = Path("aug3d_data")

Home = Annotated[Path, typer.Option(envvar=HOME_VARIABLE, help="Folder for everything that aug3d makes.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for programs; progress goes to stderr.")]
