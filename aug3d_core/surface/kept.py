"""What is made of a mesh piece by piece, kept while the stage works: a try after a kill goes on with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from aug3d_core.geometry.views import _Arrays
from aug3d_core.run.atomic_file import replacing

_Piece = TypeVar("_Piece", bound=_Arrays)


@dataclass(frozen=True)
class Kept:
    """A folder of pieces, each there whole or not at all; None keeps nothing."""

    folder: Path | None

    def has(self, name: str) -> bool:
        """Tell whether a piece is there."""
        return self.folder is not None and _file(self.folder, name).exists()

    def piece(self, name: str, kind: type[_Piece], make: Callable[[], _Piece]) -> _Piece:
        """Return a piece, which is made and kept if it is not there."""
        if self.folder is None:
            return make()
        file = _file(self.folder, name)
        if file.exists():
            return kind.load(file)
        made = make()
        self.folder.mkdir(parents=True, exist_ok=True)
        with replacing(file, file.with_name(f".{file.name}")) as opened:
            made.write(opened)
        return made


NOTHING_KEPT = Kept(None)


def _file(folder: Path, name: str) -> Path:
    return folder / f"{name}.npz"
