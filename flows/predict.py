"""`aug3d predict`: what a model is trained for - views that no photograph shows."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from aug3d_core.collections.versions import metrics_in_use, model_of
from aug3d_core.factory.build import build, work_of
from aug3d_core.factory.material import Source, source_of
from aug3d_core.factory.plan import stage_of
from aug3d_core.factory.stages import EVALUATION, PREDICTION, TRAINING
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.files import PREDICTION as NOVEL_PREDICTION
from aug3d_core.novel.files import PREDICTION_DEPTH, PREDICTION_PANEL, PREDICTION_VIEW
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import UsageError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import newest_with, object_of, records_of, step_objects, version_metrics, versions
from aug3d_core.store.store import Store
from aug3d_core.store.version_name import find_version
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.preview import TOWNS, model_named, preview
from flows.reading import read_store, version_with
from flows.refusal import typed_errors

_FARTHEST = 1e9  # world units: farther away, nothing can be seen; NaN is not less either


def predict(
    scene: Annotated[str | None, typer.Argument(help="Name of a scene with a trained model, or SCENE@VERSION.")] = None,
    photos: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Instead of a scene: a folder of photographs that aug3d has never seen."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The model of this collection or scene; towns: the one that aug3d ships. Default: the scene's own.",
        ),
    ] = None,
    inputs: Annotated[
        str | None,
        typer.Option(
            metavar="PHOTO,...",
            help="Photographs to predict from, by id or name. Default: those that together show most of the view.",
        ),
    ] = None,
    like: Annotated[
        str | None, typer.Option(metavar="PHOTO", help="View the scene as this photograph does, without looking at it.")
    ] = None,
    at: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Put the camera here, in the scene's world (z is up).")
    ] = None,
    look_at: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Point the camera at this place; goes with --at.")
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Use the photographs of this nerfstudio transforms.json, not the scene's."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|DIR",
            help="Also write the view here, its depth and inputs beside; with --photos, a new folder.",
        ),
    ] = None,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Predict a view that no photograph shows, with a scene's trained model.

    Without options: a view amid the photographs that look at the middle of the scene. With --poses: from any undistorted
    photographs with poses, in the scene's world or with a point cloud. Exit code 3: most of what is in view no input shows.

    With --photos: finds the poses of a folder of photographs, and predicts some from the others and a flight, in minutes. Exit
    code 3: the model may be no better there than an answer without learning.
    """
    with typed_errors(as_json, home):
        if (scene is None) == (photos is None):
            raise UsageError("predict takes a scene, or --photos DIR", "give one of them")
        if photos is not None:
            if any(option is not None for option in (inputs, like, at, look_at, poses)):
                raise UsageError(
                    "--photos goes with --model and --out alone", "run the photographs as a scene for the rest"
                )
            raise typer.Exit(preview(Store(home), photos, model or TOWNS, out, as_json))
        assert scene is not None
        if out is not None and (out.suffix.lower() != ".png" or not out.parent.is_dir()):
            raise UsageError(f"--out {out} is no PNG file in a folder that exists", "name one like view.png")
        store = read_store(home)
        with store.using():
            version = version_with(store, scene, "dataset", *(() if model else ("training",)))
            sources = _sources(store, version, model, poses)
            named_in = poses or store.files_dir(object_of(store, version, "photos"), [PHOTO_TABLE])
            config = _config(named_in, inputs, like, _place("--at", at), _place("--look-at", look_at))
            config = config.model_copy(update={"input_views": _input_views(store, version, model)})
            with Console(stderr=True).status("predicting ..."):
                record = build(store, work_of(PREDICTION, config, sources), lambda done, total, what: None).record
            files = _handed_over(store.files_dir(record), out)
            view = json.loads((store.files_dir(record) / PREDICTION_VIEW).read_text())
            told = _told(scene, record, files, view, fold_notes(step_objects(version)))
            print(json.dumps(told, indent=1)) if as_json else _print(told)
        raise typer.Exit(3 if record.state == "degraded" else 0)


def _sources(store: Store, version: Mapping[str, Any], model: str | None, poses: Path | None) -> dict[str, Source]:
    """Return what the stage reads: the scene's data set, its model or the one that is named, and photographs from outside."""
    sources = {"dataset": source_of(store, object_of(store, version, "dataset"))}
    sources["training"] = (
        model_named(store, model) if model else source_of(store, object_of(store, version, "training"))
    )
    if poses is not None:
        sources["given"] = _outside(poses)
    return sources


def _outside(poses: Path) -> Source:
    """Return posed photographs from outside as an input of the stage."""
    from aug3d_core.novel.outside import photos_digest

    if poses.suffix != ".json" or not poses.is_file():
        raise UsageError(
            f"--poses {poses} is no file that ends in .json", "give a transforms.json as nerfstudio writes it"
        )
    return Source(path=poses.resolve(), digest=photos_digest(poses))


def _config(
    named_in: Path,
    inputs: str | None,
    like: str | None,
    at: tuple[float, float, float] | None,
    look_at: tuple[float, float, float] | None,
) -> PredictionConfig:
    """Check how the options go together, and turn names of photographs into ids.

    named_in: a transforms.json, or the folder of the stage `photos`.
    """
    if (at is None) != (look_at is None):
        raise UsageError("--at and --look-at go together", "give both, as X,Y,Z in the scene's world")
    if at is not None and at == look_at:
        raise UsageError("--at and --look-at are the same place", "point the camera at another one")
    if like is not None and at is not None:
        raise UsageError("--like and --at both say where the camera stands", "give one of them")
    ids: tuple[int, ...] = ()
    shown: int | None = None
    if inputs is not None or like is not None:
        from aug3d_core.novel.outside import photo_names  # with pandas, which other commands do without
        from aug3d_core.photos.files import read_photos
        from aug3d_core.photos.table import photo_ids

        table = photo_names(named_in) if named_in.is_file() else read_photos(named_in)
        ids = photo_ids(table, inputs.split(",")) if inputs is not None else ()
        shown = photo_ids(table, [like])[0] if like is not None else None
    if len(set(ids)) < len(ids):
        raise UsageError(f"--inputs {inputs} names a photograph twice", "name each once")
    if shown in ids:
        raise UsageError(
            f"--like {like} is among --inputs", "the view that is predicted cannot be an input: leave it out"
        )
    return PredictionConfig(inputs=ids, like=shown, at=at, look_at=look_at)


def judged_with(store: Store, version: Mapping[str, Any]) -> int:
    """Return from how many photographs the scene's model predicted its test; untested, how many it was trained with."""
    records = records_of(store, version)
    return int((records.get("evaluation") or records["training"]).config["input_views"])


def _input_views(store: Store, version: Mapping[str, Any], model: str | None) -> int:
    """Return from how many photographs the model of this name predicted its test, with how many it was trained if it has none.

    Without a name, the scene's own.
    """
    if model is None:
        return judged_with(store, version)
    if model == TOWNS:
        return PredictionConfig().input_views  # as docs/weights.md has its test
    if "@" in model:
        return judged_with(store, version_metrics(find_version(store, model)))
    if versions(store, model, layout.COLLECTIONS):
        objects = metrics_in_use(store, model)["objects"]
        judged = (store.find(stage, key) for stage, key in objects if stage == EVALUATION.name)
        return int(next(filter(None, judged), model_of(store, model)).config["input_views"])
    return judged_with(store, newest_with(store, model, "training")[0])


def _place(option: str, text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = map(float, text.split(","))
        if not all(abs(number) < _FARTHEST for number in (x, y, z)):
            raise ValueError(text)
    except ValueError as error:
        raise UsageError(
            f"{option} {text!r} is not three finite numbers", f"write for example {option} 10,-5,40"
        ) from error
    return x, y, z


def _handed_over(files: Path, out: Path | None) -> dict[str, str]:
    """Return where the pictures are: in the store, or where the user wanted a copy."""
    pictures = {"picture": NOVEL_PREDICTION, "depth": PREDICTION_DEPTH, "panel": PREDICTION_PANEL}
    pictures = {what: name for what, name in pictures.items() if (files / name).exists()}  # a head may predict no depth
    if out is None:
        return {what: str(files / name) for what, name in pictures.items()}
    there = {what: out.with_stem(f"{out.stem}_{what}") for what in pictures} | {"picture": out}
    for what, path in there.items():
        shutil.copyfile(files / pictures[what], path)
    return {what: str(path) for what, path in there.items()}


def fold_notes(steps: Iterable[str]) -> list[str]:
    """Say which model it is, of a scene that has one for each fold."""
    folds = sum(stage_of(step) is TRAINING for step in steps)
    return [f"the scene has {folds} folds, each with its own model: this is the first fold's"] if folds > 1 else []


def _told(
    scene: str, record: Record, files: Mapping[str, str], view: Mapping[str, Any], notes: list[str]
) -> dict[str, Any]:
    return {
        "scene": scene,
        "state": record.state,
        **files,
        **view,
        "metrics": record.metrics,
        "notes": [*record.notes, *notes],
    }


def _print(told: Mapping[str, Any]) -> None:
    photos, figures = ", ".join(map(str, told["inputs"])), told["metrics"]
    console = Console()
    lines = {"view": told["picture"], "depth": told.get("depth", "none"), "with inputs": told["panel"]}
    lines["from photos"] = f"{photos}; they show {figures['ground_seen_share']:.0%} of the ground in view"
    if "depth_near" in figures:
        lines["depth range"] = (
            f"{figures['depth_near']:.4g} (bright) to {figures['depth_far']:.4g}, world units along z"
        )
    if "psnr" in figures:
        lines["against it"] = f"{figures['psnr']:.2f} dB, SSIM {figures['ssim']:.3f}"
    for name, value in lines.items():
        console.print(f"{name:>12}  {value}", highlight=False, soft_wrap=True, markup=False)
    for note in told["notes"]:
        console.print(f"[yellow]note[/] {escape(note)}", highlight=False)
