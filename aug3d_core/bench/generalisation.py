"""How good the shipped model is where it has never been, what tuning it gains, and how fast many scenes are read."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.bench.figure import Figure, at_least, at_most, told
from aug3d_core.bench.scores import free_column, mean, scene_scores
from aug3d_core.collections.towns import town_works
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.new_views import only
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.writer import write
from aug3d_core.factory.build import work_of
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material, Source, source_of
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import DATASET, EVALUATION, PREVIEW, TO_POSES, TRAINING
from aug3d_core.factory.walk import Make, Visit, walk
from aug3d_core.heads.config import shipped
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import lead
from aug3d_core.novel.config import PreviewConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, single, tried
from aug3d_core.training.config import TrainingConfig

GOALS = {
    "ochota_zero_shot": {"free_over_homography_db": 3.0, "free_over_sweep_db": 2.0},
    "brighton_zero_shot": {"free_over_homography_db": 1.5, "free_over_sweep_db": 1.0},
}
LEADS = ("zero_shot_over_homography_db", "zero_shot_over_sweep_db", "tuned_over_scratch_db")
TUNED_MINUTES, RANDOM_MINUTES = 2.0, 10.0  # of processor time
TOWNS, TOWN_STEPS = (1, 3, 10, 30), 600
SCENES, VIEWS, LOADED_STEPS = 20, 500, 60
INPUT_VIEWS = 3
FLIGHT_PHOTOS, FLIGHT_MINUTES = 30, 5.0


def figures(store: Store, scene: Measured, say: Say, photos: Mapping[str, Path], towns: bool) -> dict[str, Figure]:
    """Measure on folders of photographs; and the reading of many scenes."""
    make, found = directly(store, say), {}
    model = _shipped()
    tests: dict[str, list[Record]] = {}
    for name, folder in photos.items():
        trial = _packed(store, folder, make)
        if trial.failure:
            found[name] = _failed(trial)
            continue
        tests[name] = trial.of(["dataset"])
        of, views = f"{name}_zero_shot", _judged(store, tests[name], model, make)
        found |= {of: _failed(views)} if isinstance(views, Trial) else scene_scores(views, of, GOALS.get(of, {}))
        found |= _tuned(store, scene, tests[name][0], name, make)
        found |= _flight(store, folder, name, model, make)
    if towns and tests:
        found |= _by_towns(store, scene, tests, make)
    return _worst(found) | found | reading(store, scene, make)


def _worst(found: Mapping[str, Figure]) -> dict[str, Figure]:
    """Return the leads from the inputs alone, and the share of the time that tuning takes, of the place where each is worst."""
    worst = {}
    for key in LEADS:
        of = key.replace("_over_", "_free_over_") if key.startswith("zero") else key
        values = [
            figure.value for name, figure in found.items() if name.endswith(f"_{of}") and figure.value is not None
        ]
        worst |= {key: Figure(min(values), "dB")} if values else {}
    shares = [figure.value for name, figure in found.items() if name.endswith("_tuned_time_share") and figure.value]
    return worst | ({"tuned_time_share": Figure(max(shares), "1")} if shares else {})


def _shipped() -> Source:
    folder, digest, modules = shipped()
    return Source(path=folder, digest=digest, modules=modules)


def _packed(store: Store, folder: Path, make: Make) -> Trial:
    material = Material(photos=folder)
    stages = material.stages()
    return tried(walk(store, stages[: stages.index(DATASET) + 1], scene_config("auto"), material, make))


def _failed(trial: Trial) -> Figure:
    return Figure(None, "dB", None, None, trial.failure)


def _judged(store: Store, datasets: list[Record], model: Source, make: Make) -> pd.DataFrame | Trial:
    """Return the scores of a model on the test of every fold, or the trial of the first that failed."""
    config = EvaluationConfig(input_views=INPUT_VIEWS, panels=0, flythrough_frames=0)
    tables = []
    for data in datasets:
        sources = {"dataset": source_of(store, data), "training": model}
        trial = tried(single(EVALUATION, config, sources, make))
        if trial.failure:
            return trial
        tables.append(pd.read_parquet(store.file(trial.records["evaluation"], TEST_VIEWS)))
    return pd.concat(tables, ignore_index=True)


def _tuned(store: Store, scene: Measured, data: Record, name: str, make: Make) -> dict[str, Figure]:
    """Train on a scene for two minutes from the shipped weights, and for ten from random ones."""
    config = scene.config().training
    few = _trained(store, _lasting(config.started("towns"), 20), {"dataset": data}, make)
    if few.failure:
        return {f"{name}_tuned": _failed(few)}
    step_s = few.cpu_seconds(["training"]) / 20
    found: dict[str, Figure] = {}
    scores, minutes = {}, {}
    for how, base, most in (
        ("tuned", config.started("towns"), TUNED_MINUTES),
        ("scratch", config.from_random(), RANDOM_MINUTES),
    ):
        trial = _trained(store, _lasting(base, max(int(60 * most / step_s), 1)), {"dataset": data}, make)
        if trial.failure:
            return {f"{name}_{how}": _failed(trial)}
        views = _judged(store, [data], source_of(store, trial.records["training"]), make)
        if isinstance(views, Trial):
            return {f"{name}_{how}": _failed(views)}
        scores[how] = views
        minutes[how] = trial.cpu_seconds(["training"]) / 60
        found |= scene_scores(scores[how], f"{name}_{how}", {})
        found[f"{name}_{how}_minutes"] = Figure(minutes[how], "min")
    found[f"{name}_tuned_time_share"] = Figure(minutes["tuned"] / minutes["scratch"], "1")
    for key, column in (("tuned_over_scratch", free_column(scores["tuned"])), ("tuned_over_scratch_scaffold", "psnr")):
        both = scores["tuned"].assign(other=scores["scratch"][column])
        by, ends = lead(both, column, "other")
        found[f"{name}_{key}_db"] = at_least(0.0, by, "dB")
        found |= {
            f"{name}_{key}_{end}": Figure(value, "dB")
            for end, value in zip(("low", "high"), ends or (None, None), strict=True)
        }
    return found


def _lasting(config: TrainingConfig, steps: int) -> TrainingConfig:
    warmup_steps = min(config.warmup_steps, steps // 10)
    return config.model_copy(update={"steps": steps, "warmup_steps": warmup_steps, "least_gain_db": 0.0})


def _trained(store: Store, config: TrainingConfig, data: Mapping[str, Record], make: Make) -> Trial:
    return tried(single(TRAINING, config, {name: source_of(store, record) for name, record in data.items()}, make))


def _by_towns(store: Store, scene: Measured, tests: Mapping[str, list[Record]], make: Make) -> dict[str, Figure]:
    """Train on ever more towns for as many steps, and judge on the photographs."""
    config, found, packed = _lasting(scene.config().training.from_random(), TOWN_STEPS), {}, {}
    for name, work in town_works(max(TOWNS), 0, scene.config().dataset.width_px):
        built = make(Visit(Step(work.stage), work))
        assert built
        packed[name] = built.record
    for count in TOWNS:
        trial = _trained(store, config, dict(list(packed.items())[:count]), make)
        for name, datasets in tests.items():
            of, views = f"{name}_{count}_towns", trial
            if not trial.failure:
                views = _judged(store, datasets, source_of(store, trial.records["training"]), make)
            if isinstance(views, Trial):
                found[f"{of}_free"] = _failed(views)
                continue
            found[f"{of}_free"] = Figure(mean(views, free_column(views)), "dB")
            found[f"{of}_scaffold"] = Figure(mean(views, "psnr"), "dB")
    for name in tests:
        one, most = (found[f"{name}_{count}_towns_free"].value for count in (1, max(TOWNS)))
        over = None if one is None or most is None else most - one
        found[f"{name}_{max(TOWNS)}_towns_over_one"] = at_least(0.5, over, "dB")
    return found


def _flight(store: Store, folder: Path, name: str, model: Source, make: Make) -> dict[str, Figure]:
    """Time the way from a folder of at most 30 photographs to a flight, with nothing in the store."""
    fresh = store.root / "flight"
    shutil.rmtree(fresh, ignore_errors=True)
    some = fresh / "photos"
    some.mkdir(parents=True)
    for photo in sorted(folder.iterdir())[:FLIGHT_PHOTOS]:
        os.link(photo, some / photo.name) if photo.stat().st_dev == some.stat().st_dev else shutil.copy(photo, some)
    begun, inside = time.monotonic(), Store(fresh / "home")
    make = directly(inside, lambda *_: None)
    trial = tried(walk(inside, TO_POSES, scene_config("auto"), Material(photos=some), make))
    if trial.failure:
        return {f"{name}_flight": Figure(None, "min", None, None, trial.failure)}
    sources = {"sfm": source_of(inside, trial.records["sfm"]), "training": model}
    shown = tried(single(PREVIEW, PreviewConfig(), sources, make))
    minutes = (time.monotonic() - begun) / 60
    shutil.rmtree(fresh)
    if shown.failure:
        return {f"{name}_flight_minutes": Figure(None, "min", FLIGHT_MINUTES, False, shown.failure)}
    return {
        f"{name}_flight_minutes": at_most(FLIGHT_MINUTES, minutes, "min"),
        f"{name}_flight_over_homography": Figure(told(shown, "preview", "over_homography_db"), "dB"),
    }


def reading(store: Store, scene: Measured, make: Make) -> dict[str, Figure]:
    """Train on 20 scenes of 500 views at 256 x 192 px: one scene's files under 20 names, each read as a scene of its own."""
    (name, work), *_ = town_works(1, 0, 256)
    built = make(Visit(Step(work.stage), work))
    assert built
    town = read(store.files_dir(built.record) / SCENE_ZARR)
    rows = np.resize(np.arange(len(town)), VIEWS)
    many = replace(only(town, rows), groups=town.groups)
    top = store.root / "reading"
    shutil.rmtree(top, ignore_errors=True)
    (top / "0").mkdir(parents=True)
    write(many, top / "0" / SCENE_ZARR, shard_views=64)
    for number in range(1, SCENES):
        shutil.copytree(top / "0", top / str(number), copy_function=os.link)
    sources = {
        f"scene{number:02d}": Source(path=top / str(number), digest=f"{name}{number}") for number in range(SCENES)
    }
    config = _lasting(scene.config().training.from_random(), LOADED_STEPS)
    trial = tried([Visit(Step(TRAINING), built=make(Visit(Step(TRAINING), work_of(TRAINING, config, sources))))])
    shutil.rmtree(top)
    return {
        "loader_peak_mib": at_most(2048, trial.peak_mib(["training"]) or None, "MiB"),
        "loader_wait_share": at_most(0.05, told(trial, "training", "loader_wait_share"), "1"),
    }
