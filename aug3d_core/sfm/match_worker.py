"""The matching process: `python -m aug3d_core.sfm.match_worker job.json` compares shards of pairs, one after the other.

On one thread: on several, COLMAP's matcher loses or changes the matches of about one pair in a thousand, and of other pairs
each time (four of four runs over 8,698 pairs; as many on one thread were the same, and took an eighth less processor time).
"""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pycolmap

from aug3d_core.run.helper_process import begin
from aug3d_core.run.stage import Frozen
from aug3d_core.sfm.matching_shards import FEATURE_TABLES, MATCH_TABLES, Shard


class PairsTask(Frozen):
    """A shard of pairs of photographs, by their ids in the database, and those of them that are not matched yet."""

    pairs: tuple[tuple[int, int], ...]
    new: tuple[tuple[int, int], ...]


class MatchJob(Frozen):
    """The shards of one worker. database: is read only; shards: the folder that they go to."""

    database: Path
    shards: Path
    seed: int
    tasks: tuple[PairsTask, ...]


def main() -> None:
    """Work through the job named on the command line; each shard is reported by the number of pairs compared."""
    job, report = begin(MatchJob)
    pycolmap.logging.minloglevel = 1
    for task in job.tasks:
        shard = Shard.of_pairs(job.shards, task.pairs)
        if not shard.file.exists():  # another machine may have made it meanwhile
            with tempfile.TemporaryDirectory(dir=job.database.parent) as scratch:
                part = Path(scratch) / "part.db"
                names = _copy_part(job.database, part, {photo for pair in task.pairs for photo in pair}, shard.ids)
                _match(part, [(names[i], names[j]) for i, j in task.new], job.seed)
                shard.give(part)
        report(str(len(task.new)))


def _copy_part(database: Path, part: Path, photos: Iterable[int], pairs: Iterable[int]) -> dict[int, str]:
    """Make a database of some photographs' features and some pairs' matches; return the photographs' names by id."""
    pycolmap.Database.open(part).close()
    of_ids = dict.fromkeys(FEATURE_TABLES, photos) | dict.fromkeys(MATCH_TABLES, pairs)
    with closing(sqlite3.connect(part, uri=True)) as connection:
        connection.execute("ATTACH ? AS whole", (f"{database.absolute().as_uri()}?mode=ro",))
        tables = connection.execute("SELECT name FROM whole.sqlite_master WHERE type = 'table'").fetchall()
        for (table,) in tables:
            if table.startswith("sqlite_"):
                continue
            copied = f"INSERT INTO main.{table} SELECT * FROM whole.{table}"
            if table not in of_ids:
                connection.execute(copied)
            for row in of_ids.get(table, ()):
                connection.execute(f"{copied} WHERE rowid = ?", (row,))
        connection.commit()
        return dict(connection.execute("SELECT image_id, name FROM main.images").fetchall())


def _match(database: Path, pairs: Iterable[tuple[str, str]], seed: int) -> None:
    """Match pairs, by the names of their photographs, and verify them geometrically."""
    matching, verification = pycolmap.FeatureMatchingOptions(), pycolmap.TwoViewGeometryOptions()
    matching.num_threads = 1
    verification.ransac.random_seed = seed
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = database.with_suffix(".txt")
    Path(pairing.match_list_path).write_text("".join(f"{one} {other}\n" for one, other in pairs))
    pycolmap.match_image_pairs(database, matching, pairing, verification)


if __name__ == "__main__":
    main()
