"""Check that a run fits on the disk before anything is computed.

Each missing step is expected to write at most twice what it wrote for the scene's last version. For a first run a plain rule
errs to the large side: three to five times what real runs of the preset tiny wrote.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step
from aug3d_core.photos.discover import find_photos
from aug3d_core.run.errors import InputError, StoreError
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_MIB = 2**20
_SPARE_BYTES = 64 * _MIB  # the report, MLflow's copy of it, databases, logs
_FIXED_BYTES = 512 * _MIB  # of a first run: weights, checkpoints, meshes, pictures
_LIKELY_K = 10
_FEW_TESTS = 8  # photographs; a smaller test is made in folds


def check_room(
    store: Store,
    scene: str,
    material: Material,
    config: SceneConfig,
    before: Mapping[str, Record],
    plan: Iterable[tuple[Step, Record | None]],
) -> None:
    """Raise StoreError if a run may not fit on the store's disk. `before` holds the records of the last version by step."""
    needed = needed_bytes(material, config, before, [step for step, record in plan if record is None])
    free = shutil.disk_usage(store.root).free
    if needed > free:
        raise StoreError(
            f"scene {scene!r} may need {size_words(needed)} on the disk of {store.root}, where {size_words(free)} are free",
            "free space with aug3d gc, choose another disk with --home DIR, or use a smaller preset",
        )


def needed_bytes(material: Material, config: SceneConfig, before: Mapping[str, Record], missing: Sequence[Step]) -> int:
    """Return what a run may write in the steps that are missing; 0 if none is, or the photographs cannot be read.

    The stage that cannot read them reports it.
    """
    if not missing:
        return 0
    last = [before.get(step.name) or before.get(step.stage.name) for step in missing]
    known = [record.size_bytes for record in last if record]
    try:
        written = 2 * sum(known) if len(known) == len(last) else first_run_bytes(material, config)
    except InputError:
        return 0
    return written + _SPARE_BYTES


def first_run_bytes(material: Material, config: SceneConfig) -> int:
    """Return a generous estimate of what the first run of a scene writes, temporary files included."""
    photos = len(find_photos(material.photos).names) if material.photos else _town_photos(config)
    photo_px = config.photos.max_px if material.photos else min(config.photos.max_px, config.town.width_px)
    depth_px = min(photo_px, config.depth.max_px)
    share, domes = config.grouping.test_share, config.sampling
    folds = config.grouping.folds or (round(1 / share) if share * photos < _FEW_TESTS else 1)
    views = domes.domes * (domes.views_per_dome or (_LIKELY_K if config.grouping.k == "auto" else config.grouping.k))
    rendered = 10 * views * domes.width_px * domes.height_px
    # PNGs and features; each depth and normal map in float32, twice while patch match works
    return _FIXED_BYTES + photos * 8 * photo_px**2 + folds * (photos * 32 * depth_px**2 + rendered)


def _town_photos(config: SceneConfig) -> int:
    import numpy as np

    from aug3d_core.town.drone.flight import plan_flight

    return len(plan_flight(config.town, np.random.default_rng(0)))


def size_words(size_bytes: int) -> str:
    """Return a size as people read it."""
    return f"{size_bytes / 2**30:.1f} GiB" if size_bytes >= 2**30 else f"{size_bytes / _MIB:.0f} MiB"
