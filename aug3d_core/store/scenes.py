"""Versions of a scene: `scenes/<scene>/<time>/` holds the report and `metrics.json` of one run.

Those of a collection lie in `collections/<name>/<time>/`. `top` says which: `layout.SCENES` or `layout.COLLECTIONS`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.damage import sha256_of
from aug3d_core.store.published import published
from aug3d_core.store.record import Record
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.seal import sealed, unsealed
from aug3d_core.store.store import Store
from aug3d_core.store.timed import timed_folder

DIGESTS = "digests"  # in `metrics.json`: of the files beside it


def new_version(store: Store, name: str, top: str = layout.SCENES) -> Path:
    """Create the folder of a new version, named by the time in UTC so that names sort."""
    return timed_folder(store.root / top / check_scene_name(name))


def bring_versions(store: Store, scene: str | None = None) -> None:
    """Bring the versions of a scene, or of all, here that other machines have made, and what is published.

    `versions` and `scenes` do so the first time that a `Store` is asked for them: a command, and a run, opens one.
    """
    store.bring_versions(layout.SCENES, scene and check_scene_name(scene), again=True)


def write_metrics(version: Path, metrics: Mapping[str, Any]) -> None:
    """Write a version's `metrics.json`, sealed, with the digest of the report; a version counts from this moment."""
    report = version / layout.REPORT
    told = {**metrics, DIGESTS: {layout.REPORT: sha256_of(report)}} if report.exists() else metrics
    write_synced(version / layout.METRICS, sealed(told))


def share_version(store: Store, version: Path, objects: Iterable[tuple[str, str]]) -> None:
    """Give a complete version to the machines that share the store, once that has all that the version names.

    Raises DamagedError where it has not, and this machine cannot give it.
    """
    if store.shared is not None:
        store.share_again(objects)
        store.shared.share_version(version)


def bring_report(store: Store, version: Path) -> None:
    """Bring the report of a version that another machine has made."""
    if store.shared is not None:
        store.shared.bring_report(version)


def version_paths(store: Store, version: Path, records: Mapping[str, Record]) -> dict[str, Any]:
    """Return where everything of a version lies: metrics, report, the MLflow store, the files of each step."""
    return _paths(store, version, {step: (record.stage, record.key) for step, record in records.items()})


def paths_here(store: Store, version: Path, metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return where everything of a version lies on this machine: its metrics tell where the machine that made it has it."""
    return _paths(store, version, step_objects(metrics))


def _paths(store: Store, version: Path, objects: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    return {
        "metrics": str(version / layout.METRICS),
        "report": str(version / layout.REPORT),
        "mlflow": masked(mlflow_address(store)),
        "objects": {step: str(store.object_dir(*item) / FILES) for step, item in objects.items()},
    }


def mlflow_address(store: Store) -> str:
    """Return where MLflow keeps its runs: the user's server, or a database in the store. It may hold a password."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{store.root / layout.MLFLOW_DATABASE}"


def masked(text: str) -> str:
    """Return a text, as it may be kept and shown, without the user and the password of the addresses in it."""
    return re.sub(r"(?<=://)[^/\s]*@", "***@", text)


def scenes(store: Store, top: str = layout.SCENES) -> list[str]:
    """Return the names of all scenes that have a version, or of all collections."""
    store.bring_versions(top)
    files = (store.root / top).glob(f"*/[!.]*/{layout.METRICS}")
    return sorted({path.parent.parent.name for path in files if not metrics_fault(path.parent)})


def versions(store: Store, name: str, top: str = layout.SCENES) -> list[Path]:
    """Return the folders of the versions that count, oldest first."""
    store.bring_versions(top, check_scene_name(name))
    folder = store.root / top / name
    return sorted(path.parent for path in folder.glob(f"[!.]*/{layout.METRICS}") if not metrics_fault(path.parent))


def damaged_versions(store: Store, scene: str) -> list[str]:
    """Say which versions of a scene count as absent, and why: their `metrics.json` is empty or not what was written."""
    folder = store.root / layout.SCENES / check_scene_name(scene)
    found = ((path, metrics_fault(path.parent)) for path in sorted(folder.glob(f"[!.]*/{layout.METRICS}")))
    return [f"{path} {what}: the version counts as absent" for path, what in found if what]


def metrics_fault(version: Path) -> str:
    """Return what is wrong with the `metrics.json` of a version, "" if it is whole."""
    try:
        version_metrics(version)
    except StoreError as error:
        return error.problem.removeprefix(f"{version / layout.METRICS} ")
    return ""


def report_fault(store: Store, version: Path) -> str:
    """Return what is wrong with the report of a version, "" if it is whole, older than digests, or elsewhere."""
    for name, digest in unsealed((version / layout.METRICS).read_bytes()).get(DIGESTS, {}).items():
        if not (version / name).is_file() and store.shared is not None:  # it comes when it is asked for
            continue
        if not (version / name).is_file():
            return f"{name} is missing"
        if sha256_of(version / name) != digest:
            return f"{name} holds other bytes than were written"
    return ""


def version_metrics(version: Path) -> dict[str, Any]:
    """Return the `metrics.json` of a version; raises StoreError if it is not what was written."""
    file = version / layout.METRICS
    content = file.read_bytes()
    try:
        return {name: value for name, value in unsealed(content).items() if name != DIGESTS}
    except ValueError as error:
        what = f"is damaged ({error})" if content else "is empty"
        raise StoreError(
            f"{file} {what}", "aug3d verify --repair puts the version aside; run the scene to have another"
        ) from error


def last_version(store: Store, scene: str) -> dict[str, Any]:
    """Return the `metrics.json` of a scene's newest version; raises UsageError if there is none."""
    found = versions(store, scene)
    if not found:
        if damaged := damaged_versions(store, scene):
            raise StoreError(
                f"scene {scene!r} has no whole version: {damaged[-1]}", "aug3d verify --repair, then run it again"
            )
        if file := _registered(store, scene):
            raise UsageError(f"scene {scene!r} is registered ({file}) and was never run", f"aug3d run {scene} runs it")
        known = ", ".join(scenes(store)) or "none yet"
        raise UsageError(
            f"there is no scene {scene!r} in {store.root}", f"scenes here: {known}; make one with aug3d run"
        )
    return version_metrics(found[-1])


def newest_with(store: Store, scene: str, *steps: str) -> tuple[dict[str, Any], str]:
    """Return the `metrics.json` of a scene's newest version that made these steps, and why it is not the last one, "" if it is.

    Where none made them all, it is the newest of those that made most of them. Raises as `last_version` does.
    """
    last = last_version(store, scene)
    missing = [step for step in steps if step not in step_objects(last)]
    if not missing:
        return last, ""
    newest_first = versions(store, scene)[::-1]
    read = [version_metrics(version) for version in newest_first]
    made = [len(step_objects(metrics).keys() & set(steps)) for metrics in read]
    best = made.index(max(made))
    note = f"the last run of {scene} ended before {missing[0]}: this is its version of {newest_first[best].name}"
    return read[best], note if best else ""


def newest_whole(store: Store, scene: str) -> dict[str, Any]:
    """Return the `metrics.json` of a scene's newest version whose model was tested, in all folds; without one, of the last.

    Raises as `last_version` does.
    """
    return newest_that(store, scene, _whole)


def newest_that(store: Store, scene: str, fits: Callable[[Mapping[str, Any]], bool]) -> dict[str, Any]:
    """Return the `metrics.json` of a scene's newest version that fits; where none does, of the last.

    Raises as `last_version` does.
    """
    last = last_version(store, scene)
    read = map(version_metrics, reversed(versions(store, scene)))
    return next((metrics for metrics in read if fits(metrics)), last)


def records_before(store: Store, scene: str) -> dict[str, Record]:
    """Return what a scene was made of, by step: in the published version, else when each was last made; without what is gone.

    A run that ended early made some steps anew; the others are those of the newest whole version.
    """
    metrics = published_metrics(store, scene)
    if metrics:
        return records_of(store, metrics)
    records: dict[str, Record] = {}
    for version in reversed(versions(store, scene)):
        metrics = version_metrics(version)
        records = records_of(store, metrics) | records
        if _whole(metrics):
            break
    return records


def _whole(metrics: Mapping[str, Any]) -> bool:
    """Whether a version's model was tested, in all folds: only then it has the figures of its views."""
    return "nvs" in metrics


def published_metrics(store: Store, scene: str) -> dict[str, Any] | None:
    """Return the `metrics.json` of the published version; None if there is none, or it is damaged or gone."""
    try:
        version = published(store, scene)
        return version_metrics(version) if version else None
    except StoreError:
        return None


def step_objects(metrics: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Return the stage and the key of each step's object, as a version names them."""
    if "objects" in metrics:
        return {step: (named["stage"], named["key"]) for step, named in metrics["objects"].items()}
    # Up to 0.6 a version held only the paths of its objects, in a store that may have been moved since
    folders = {step: Path(files).parent for step, files in metrics["paths"]["objects"].items()}
    return {step: (folder.parent.name, folder.name) for step, folder in folders.items()}


def records_of(store: Store, metrics: Mapping[str, Any]) -> dict[str, Record]:
    """Return what a version is made of, by step; what is gone is left out."""
    found = {step: store.find(stage, key) for step, (stage, key) in step_objects(metrics).items()}
    return {step: record for step, record in found.items() if record is not None}


def object_of(store: Store, metrics: Mapping[str, Any], step: str) -> Record:
    """Return what a step of a version made; raises UsageError if it made none, StoreError if the files are gone."""
    scene, objects = metrics["scene"], step_objects(metrics)
    if step not in objects:
        raise UsageError(
            f"scene {scene!r} has no {step}: its run ended before", f"see aug3d show {scene}, then run again"
        )
    record = store.find(*objects[step])
    if record is None:
        raise StoreError(f"the {step} of scene {scene!r} is gone from {store.root}", "run the scene again")
    return record


def _registered(store: Store, scene: str) -> Path | None:
    """Return the file that registers a scene, if there is one."""
    files = (store.root / layout.SCENES / f"{scene}{ending}" for ending in layout.SCENE_FILES)
    return next((file for file in files if file.exists()), None)
