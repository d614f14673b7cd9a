"""A shard that cannot be taken: torn ones go, whole ones stay."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pycolmap
import pytest

from aug3d_core.sfm.matching_shards import Shard


def given(folder: Path) -> Shard:
    """Return the shard of one photograph's features, written from a database that has them."""
    made, shard = folder / "made.db", Shard.of_photos(folder / "shards", [1])
    pycolmap.Database.open(made).close()
    with closing(sqlite3.connect(made)) as connection:
        connection.execute("INSERT INTO keypoints VALUES (1, 1, 4, ?)", (bytes(9000),))
        connection.commit()
    shard.give(made)
    return shard


@pytest.mark.parametrize("size", [0, 50, 5000])
def test_a_torn_one_is_deleted_to_be_made_again(tmp_path: Path, size: int) -> None:
    shard = given(tmp_path)
    os.truncate(shard.file, size)
    pycolmap.Database.open(tmp_path / "mine.db").close()
    assert not shard.take(tmp_path / "mine.db")
    assert not shard.file.exists()


def test_where_the_database_cannot_take_it_the_error_is_told_and_the_shard_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made again and again, it would never be taken."""
    shard, mine = given(tmp_path), tmp_path / "mine.db"
    pycolmap.Database.open(mine).close()
    connect = sqlite3.connect

    def full(database: Path, **more: bool) -> sqlite3.Connection:
        connection = connect(database, **more)
        connection.execute("PRAGMA max_page_count = 1")
        return connection

    with monkeypatch.context() as patch:
        patch.setattr(sqlite3, "connect", full)
        with pytest.raises(sqlite3.DatabaseError, match="full"):
            shard.take(mine)
    assert shard.file.exists()
    assert shard.take(mine)
