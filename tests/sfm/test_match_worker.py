"""A worker's part of the database, and how it compares pairs."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pycolmap
import pytest

from aug3d_core.run.helper_process import ONE_THREAD
from aug3d_core.sfm.match_worker import _copy_part, _match


def rows(database: Path, asked: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(database)) as connection:
        return connection.execute(asked).fetchall()


def test_a_part_has_the_features_of_its_photographs_the_matches_of_its_pairs_and_all_names(tmp_path: Path) -> None:
    whole, pairs = (
        tmp_path / "whole.db",
        {one: pycolmap.image_pair_to_pair_id(*one) for one in ((1, 2), (1, 3), (2, 4))},
    )
    pycolmap.Database.open(whole).close()
    with closing(sqlite3.connect(whole)) as connection:
        for photo in range(1, 5):
            connection.execute("INSERT INTO images VALUES (?, ?, 1)", (photo, f"{photo}.png"))
            connection.execute("INSERT INTO keypoints VALUES (?, 1, 4, ?)", (photo, bytes([photo])))
        for pair in pairs.values():
            connection.execute("INSERT INTO matches VALUES (?, 1, 2, ?)", (pair, b"found"))
        connection.commit()
    before = whole.read_bytes()
    named = _copy_part(whole, tmp_path / "part.db", {1, 2}, [pairs[1, 2]])
    assert named == {photo: f"{photo}.png" for photo in range(1, 5)}
    assert rows(tmp_path / "part.db", "SELECT image_id, data FROM keypoints") == [(1, b"\1"), (2, b"\2")]
    assert rows(tmp_path / "part.db", "SELECT pair_id, data FROM matches") == [(pairs[1, 2], b"found")]
    assert whole.read_bytes() == before


def test_pairs_are_matched_on_one_thread_or_some_would_be_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[Any, ...]] = []
    monkeypatch.setattr(pycolmap, "match_image_pairs", lambda *given: seen.append(given))
    _match(tmp_path / "part.db", [("a.png", "b.png"), ("a.png", "c.png")], 7)
    ((_, matching, pairing, verification),) = seen
    assert matching.num_threads == 1
    assert {ONE_THREAD[name] for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")} == {"1"}
    assert verification.ransac.random_seed == 7
    assert Path(pairing.match_list_path).read_text() == "a.png b.png\na.png c.png\n"
