"""Features of a few photographs, or matches of a few pairs, as a database of their own: another machine goes on with them."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pycolmap

FEATURE_TABLES, MATCH_TABLES = ("keypoints", "descriptors"), ("matches", "two_view_geometries")
_TORN = (sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)  # what SQLite says of half a file


@dataclass(frozen=True)
class Shard:
    """Some rows of two tables of COLMAP's database. ids: those of photographs, or of pairs."""

    file: Path
    tables: tuple[str, str]
    ids: tuple[int, ...]

    @classmethod
    def of_photos(cls, folder: Path, ids: Sequence[int]) -> Shard:
        """Return the shard with the features of photographs, by their ids in the database."""
        return cls._named("features", folder, FEATURE_TABLES, tuple(ids))

    @classmethod
    def of_pairs(cls, folder: Path, pairs: Sequence[tuple[int, int]]) -> Shard:
        """Return the shard with the matches of pairs, by the ids of their photographs in the database."""
        return cls._named("pairs", folder, MATCH_TABLES, tuple(pycolmap.image_pair_to_pair_id(*pair) for pair in pairs))

    @classmethod
    def _named(cls, kind: str, folder: Path, tables: tuple[str, str], ids: tuple[int, ...]) -> Shard:
        name = hashlib.sha256(json.dumps(ids).encode()).hexdigest()[:16]
        return cls(folder / f"{kind}_{name}.db", tables, ids)

    def take(self, database: Path) -> bool:
        """Copy it into a database if it is there; return whether it was. One that a power cut tore is deleted.

        Raises sqlite3.DatabaseError if the database cannot take it: the disk may be full.
        """
        if not self.file.exists():
            return False
        with closing(sqlite3.connect(database, uri=True)) as connection:
            try:
                connection.execute("ATTACH ? AS shard", (f"{self.file.absolute().as_uri()}?mode=ro&immutable=1",))
                for table in self.tables:
                    connection.execute(f"INSERT OR IGNORE INTO main.{table} SELECT * FROM shard.{table}")
                connection.commit()
            except sqlite3.DatabaseError as error:
                if error.sqlite_errorcode & 0xFF not in _TORN:
                    raise
                self.file.unlink(missing_ok=True)
                return False
        return True

    def give(self, database: Path) -> None:
        """Write it from a database, whole from the moment it has its name."""
        self.file.parent.mkdir(exist_ok=True)
        part = self.file.with_name(f".{self.file.name}")
        part.unlink(missing_ok=True)
        with closing(sqlite3.connect(database)) as connection:
            connection.execute("ATTACH ? AS shard", (str(part),))
            connection.execute("PRAGMA shard.journal_mode = OFF")
            for table in self.tables:
                chosen = f"SELECT * FROM main.{table} WHERE rowid IN (SELECT value FROM json_each(?))"
                connection.execute(f"CREATE TABLE shard.{table} AS {chosen}", (json.dumps(self.ids),))
            connection.commit()
        part.rename(self.file)
