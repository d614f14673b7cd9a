"""Two days' flights about a lake, with broken files and copies among them: what is told, and what it costs the rest."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.bench.figure import Figure, at_least, at_most
from aug3d_core.bench.scale import town_of
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import REJECTED_TABLE, read_photos
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_POSES
from aug3d_core.town.truth.pose_errors import pose_errors

DAYS: tuple[tuple[str, ...], ...] = (
    ("town.lake=true",),
    (
        "town.lake=true",
        "town.sun_azimuth_deg=235",
        "town.sun_elevation_deg=30",
        "town.path=nadir",
        "town.altitude_m=62",
    ),
)
BROKEN_SHARE, COPIED, COPIES = 0.05, 100, 3
_COPY = "_copy"
STANDS = 1.5  # times the errors of the same photographs with nothing wrong among them


def figures(store: Store, scene: Measured, say: Say, photos: int) -> dict[str, Figure]:
    """Reconstruct some photographs of two days as they were taken, and with broken files and copies among them."""
    town, make = town_of(scene, photos // len(DAYS)), directly(store, say)
    days = [run_trial(store, "town", town, day, make) for day in DAYS]
    if failed := [day for day in days if day.failure]:
        return {"town": Figure(None, "", None, None, failed[0].failure)}
    truth = {}
    for number, day in enumerate(days):
        folder = store.files_dir(day.records["town"])
        poses = Views.load(folder / TRUTH_POSES).cam_from_world
        truth |= {
            f"day{number}_{file.name}": (file, pose)
            for file, pose in zip(sorted((folder / TOWN_PHOTOS).iterdir()), poses, strict=True)
        }
    names = sorted(truth)
    files = {name: truth[name][0] for name in names}
    broken = names[:: round(1 / BROKEN_SHARE)]
    copied = [name for name in names if name not in broken][:COPIED]
    found: dict[str, Figure] = {}
    errors = {}
    usable = {name: file for name, file in files.items() if name not in broken}
    for arm, mixed in (("intact", (usable, (), ())), ("spoiled", (files, broken, copied))):
        folder = store.root / arm
        mix(*mixed, folder)
        trial = run_trial(store, "surface", town, (), make, folder)
        if trial.failure:
            return found | {arm: Figure(None, "", None, None, trial.failure)}
        registered, errors[arm] = _poses(store, trial, {name: pose for name, (_, pose) in truth.items()})
        found |= {
            f"{arm}_photos": Figure(float(trial.records["photos"].metrics["photos"] or 0), "photographs"),
            f"{arm}_registered_share": at_least(0.98, registered, "share"),
            f"{arm}_position_error_pct": Figure(errors[arm], "% of extent"),
            f"{arm}_processor_seconds": Figure(trial.cpu_seconds(list(trial.records)), "s"),
        }
        if arm == "spoiled":
            rejected = pd.read_parquet(store.file(trial.records["photos"], REJECTED_TABLE))
            found |= told_of(rejected, broken, [copy_name(name, n) for name in copied for n in range(COPIES)])
    return found | {"position_error_growth": at_most(STANDS, errors["spoiled"] / errors["intact"], "times")}


def mix(files: Mapping[str, Path], broken: Sequence[str], copied: Sequence[str], folder: Path) -> None:
    """Copy photographs: the broken ones lose their second half, of others there are copies under other names."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, file in files.items():
        content = file.read_bytes()
        (folder / name).write_bytes(content[: len(content) // 2] if name in broken else content)
        for n in range(COPIES if name in copied else 0):
            (folder / copy_name(name, n)).write_bytes(content)


def copy_name(name: str, number: int) -> str:
    """Return what a file manager calls a copy; it sorts after the photograph."""
    return f"{Path(name).stem}{_COPY}{number + 1}.jpg"


def original_name(name: str) -> str:
    """Return what a copy was made of; other names are their own."""
    return Path(name).stem.partition(_COPY)[0] + ".jpg"


def told_of(rejected: pd.DataFrame, broken: Sequence[str], copies: Sequence[str]) -> dict[str, Figure]:
    """Return the shares of broken files and copies that are named for what they are, and how many others are named.

    rejected: name and reason of each photograph that is not used. Of four files with the same content any may be the one
    that stays, so copies are counted.
    """
    duplicate = rejected["reason"].str.startswith("duplicate")
    named = set(rejected["name"][~duplicate])
    return {
        "broken_named_share": at_least(1.0, len(named & {*broken}) / len(broken), "share"),
        "copies_named_share": at_least(1.0, int(duplicate.sum()) / len(copies), "share"),
        "others_named": at_most(
            0.0, len(named - {*broken}) + max(int(duplicate.sum()) - len(copies), 0), "photographs"
        ),
    }


def _poses(store: Store, trial: Trial, true: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Return the share of usable photographs with a pose, and the median error of their positions [% of extent]."""
    table = read_photos(store.files_dir(trial.records["photos"]))
    found = Views.load(store.file(trial.records["sfm"], VIEWS))
    count = len(table)
    truth = Views(
        np.arange(count, dtype=found.photo_id.dtype),
        np.stack([true[original_name(name)] for name in table["name"]]),
        np.resize(found.intrinsics[0], (count, 4)),
        np.resize(found.size[0], (count, 2)),
    )
    errors = pose_errors(found, truth)["position_error_pct"].to_numpy()
    return len(found) / count, float(np.median(errors))
