"""Pieces that are kept: made once, whole or not there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.surface.colour import Colours
from aug3d_core.surface.kept import NOTHING_KEPT, Kept


def colours(value: int) -> Colours:
    return Colours(np.full((2, 3), value, np.uint8), np.array([True, False]))


def test_a_piece_is_made_once_and_comes_back_as_it_was(tmp_path: Path) -> None:
    kept = Kept(tmp_path / "deep" / "folder")
    assert not kept.has("a")
    kept.piece("a", Colours, lambda: colours(7))
    again = kept.piece("a", Colours, lambda: colours(8))
    assert kept.has("a") and not kept.has("b")
    np.testing.assert_array_equal(again.rgb, colours(7).rgb)
    np.testing.assert_array_equal(again.known, colours(7).known)
    assert kept.piece("b", Colours, lambda: colours(8)).rgb[0, 0] == 8


def test_without_a_folder_nothing_is_kept() -> None:
    assert [NOTHING_KEPT.piece("a", Colours, lambda v=v: colours(v)).rgb[0, 0] for v in (1, 2)] == [1, 2]
    assert not NOTHING_KEPT.has("a")


def test_a_piece_that_was_not_written_to_its_end_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Colours, file: object) -> None:
        file.write(b"half")  # type: ignore[attr-defined]
        raise OSError(28, "No space left on device")

    kept = Kept(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Colours, "write", full)
        with pytest.raises(OSError, match="No space"):
            kept.piece("a", Colours, lambda: colours(1))
    assert not kept.has("a") and not list(tmp_path.iterdir())
    assert kept.piece("a", Colours, lambda: colours(2)).rgb[0, 0] == 2
