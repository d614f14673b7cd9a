"""Photo table -> database with features and verified matches.

Every photograph is entered before features are extracted, so that ids, and with them all that follows, do not depend on
which thread finishes first; RANSAC is seeded per pair; pairs are matched on one thread a process. So any number of cores gives
the same database.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Lock

import numpy as np
import pandas as pd
import pycolmap
from jaxtyping import Int, UInt8

from aug3d_core.photos.files import image_name
from aug3d_core.run.helper_process import ONE_THREAD, run_worker
from aug3d_core.run.stage import Order, Progress
from aug3d_core.sfm.coarse import largest
from aug3d_core.sfm.config import MatchingConfig
from aug3d_core.sfm.match_worker import MatchJob, PairsTask
from aug3d_core.sfm.matching_shards import Shard

_CAMERA_MODEL = "SIMPLE_RADIAL"
_PHOTOS_PER_SHARD = 8
_SHARDS, _FEWEST_PAIRS, _MOST_PAIRS = 16, 25, 400  # of pairs: about so many shards, within so many pairs each
SHARDS = "shards"  # folder beside the database


def threads() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0))


def make_database(photos: pd.DataFrame, images: Path, database: Path) -> bool:
    """Enter the photographs, one camera for each distinct key, with its focal length as a prior where it is known.

    What a killed try has entered and found is kept; return whether there was any.
    """
    if _sound(database):
        return True
    made = database.with_name(f"new-{database.name}")
    for file in (database, made):
        _delete(file)
    pycolmap.Database.open(made).close()
    for _, same_camera in photos.groupby(["camera", "width_px", "height_px"], sort=False):
        pycolmap.import_images(
            made,
            images,
            pycolmap.CameraMode.SINGLE,
            [image_name(photo_id) for photo_id in same_camera["photo_id"]],
            _reader(same_camera),
        )
    made.rename(database)
    return False


def extract(
    photos: pd.DataFrame,
    images: Path,
    masks: Path,
    database: Path,
    config: MatchingConfig,
    progress: Progress,
    ordered: Order = list,
) -> None:
    """Extract SIFT features of every photograph that has none yet, a shard of photographs after the other.

    masks: folder of the masks of photographs that have one; a feature whose middle is masked is left out.
    """
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = threads()
    options.sift.max_num_features = config.max_features
    options.sift.first_octave = config.first_octave
    with pycolmap.Database.open(database) as opened:
        ids = image_ids(opened)
        left = [photo for photo in photos["photo_id"] if not opened.exists_descriptors(ids[photo])]
    done = len(photos) - len(left)
    for first in ordered(range(0, len(photos), _PHOTOS_PER_SHARD)):
        chunk = photos["photo_id"].tolist()[first : first + _PHOTOS_PER_SHARD]
        if not (new := sorted({*chunk} & {*left})):
            continue
        shard = Shard.of_photos(database.parent / SHARDS, [ids[photo] for photo in chunk])
        if not shard.take(database):
            names = [image_name(photo) for photo in new]
            masked = [name for name in names if (masks / name).exists()]
            if plain := [name for name in names if name not in masked]:
                pycolmap.extract_features(database, images, plain, extraction_options=options)
            if masked:  # apart: COLMAP refuses photographs whose mask is missing where it is given any
                with _masking(masks, masked) as reader:
                    pycolmap.extract_features(
                        database, images, masked, reader_options=reader, extraction_options=options
                    )
            shard.give(database)
        done += len(new)
        progress(done, len(photos), "photographs searched for features")


def read_largest(photos: pd.DataFrame, database: Path) -> list[UInt8[np.ndarray, "_ 128"]]:
    """Return the descriptors of the largest features of each photograph."""
    with pycolmap.Database.open(database) as opened:
        ids = {image.name: image.image_id for image in opened.read_all_images()}
        found = []
        for photo_id in photos["photo_id"]:
            image_id = ids[image_name(photo_id)]
            shape = opened.read_keypoints(image_id)[:, 2:]  # a11, a12, a21, a22: from the unit circle to the feature
            scale_px = np.sqrt(np.abs(shape[:, 0] * shape[:, 3] - shape[:, 1] * shape[:, 2]))
            found.append(largest(opened.read_descriptors(image_id).data, scale_px))
    return found


def match(
    pairs: Int[np.ndarray, "m 2"], database: Path, config: MatchingConfig, progress: Progress, ordered: Order = list
) -> None:
    """Match the pairs and verify them geometrically, those that are not yet, in shards of pairs; a process on each core.

    Raises WorkerDied if a process ends before its work is done.
    """
    with pycolmap.Database.open(database) as opened:
        ids = image_ids(opened)
        of_database = [(ids[i], ids[j]) for i, j in pairs.tolist()]
        left = {pair for pair in of_database if not opened.exists_two_view_geometry(*pair)}
    done, size = len(pairs) - len(left), min(_MOST_PAIRS, max(_FEWEST_PAIRS, -(-len(pairs) // _SHARDS)))

    def compared(count: int) -> None:
        nonlocal done
        done += count
        progress(done, len(pairs), "pairs of photographs compared")

    tasks: dict[Shard, PairsTask] = {}
    for first in ordered(range(0, len(pairs), size)):
        chunk = tuple(of_database[first : first + size])
        if new := tuple(pair for pair in chunk if pair in left):
            shard = Shard.of_pairs(database.parent / SHARDS, chunk)
            if shard.take(database):
                compared(len(new))
            else:
                tasks[shard] = PairsTask(pairs=chunk, new=new)
    while tasks:
        _run([*tasks.values()], database, config.seed, compared)
        tasks = {shard: task for shard, task in tasks.items() if not shard.take(database)}  # a torn one is made again


def _run(tasks: list[PairsTask], database: Path, seed: int, compared: Callable[[int], None]) -> None:
    """Compare shards of pairs in processes side by side."""
    count, lock = min(threads(), len(tasks)), Lock()

    def run(first: int) -> None:
        def report(line: str) -> None:
            with lock:
                compared(int(line))

        job = MatchJob(database=database, shards=database.parent / SHARDS, seed=seed, tasks=tuple(tasks[first::count]))
        lighter = "lower matching.max_features"
        run_worker("aug3d_core.sfm.match_worker", job, report, "a matching worker", lighter, ONE_THREAD)

    with ThreadPoolExecutor(count) as pool:
        list(pool.map(run, range(count)))


def store_sorted(database: Path, target: Path) -> None:
    """Write the database anew: its bytes then depend on what it holds, not on the order in which threads wrote it.

    Two entries of its header are set first, which otherwise tell whether COLMAP has ever deleted something.
    """
    target.unlink(missing_ok=True)  # a killed try may have begun it
    with closing(sqlite3.connect(database)) as connection:
        connection.execute("PRAGMA auto_vacuum = NONE")
        connection.execute("PRAGMA schema_version = 1")
        connection.execute("VACUUM INTO ?", (str(target),))


def image_ids(database: pycolmap.Database) -> dict[int, int]:
    """Return the database's id of each photograph."""
    ids = {image.name: image.image_id for image in database.read_all_images()}
    return {photo: ids[image_name(photo)] for photo in range(len(ids))}


def _sound(database: Path) -> bool:
    """Say whether there is a database that a power cut has not torn: COLMAP leaves syncing to the system."""
    if not database.exists():
        return False
    try:
        with closing(sqlite3.connect(database)) as connection:
            return connection.execute("PRAGMA quick_check").fetchone() == ("ok",)
    except sqlite3.DatabaseError:
        return False


def _delete(database: Path) -> None:
    for end in ("", "-journal", "-wal", "-shm"):
        database.with_name(database.name + end).unlink(missing_ok=True)


@contextmanager
def _masking(masks: Path, names: Sequence[str]) -> Iterator[pycolmap.ImageReaderOptions]:
    """Yield options that name the masks of photographs as COLMAP looks for them: a name with another `.png` added."""
    options = pycolmap.ImageReaderOptions()
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            (Path(folder) / f"{name}.png").symlink_to((masks / name).absolute())
        options.mask_path = folder
        yield options


def _reader(same_camera: pd.DataFrame) -> pycolmap.ImageReaderOptions:
    options = pycolmap.ImageReaderOptions()
    options.camera_model = _CAMERA_MODEL
    focal_px = same_camera["focal_px"].median()
    if np.isfinite(focal_px):
        width_px, height_px = same_camera[["width_px", "height_px"]].iloc[0]
        options.camera_params = f"{focal_px},{width_px / 2},{height_px / 2},0"
    return options
