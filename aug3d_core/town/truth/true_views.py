"""The true poses of the photographs that structure from motion was given.

The town numbers all its photographs; the photos stage numbers those that it keeps. Both count in the order of capture, so they
agree unless some were left out. Then photographs are told by their bytes.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import COMPONENTS
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_POSES


def true_views(town: Path, sfm: Path) -> Views:
    """Return the true views of the photographs that were not left out, by the photo_id that they have in `sfm`."""
    truth = Views.load(town / TRUTH_POSES)
    kept: list[str] = json.loads((sfm / COMPONENTS).read_text())["photo_sha256"]
    if len(kept) == len(truth):
        return truth
    photographs = sorted((town / TOWN_PHOTOS).iterdir(), key=lambda path: (len(path.name), path.name))
    number = {_sha256(path): taken for taken, path in zip(range(len(truth)), photographs, strict=True)}
    return replace(truth.take(np.array([number[sha256] for sha256 in kept])), photo_id=np.arange(len(kept)))


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
