"""From a document to a checked entry. Every mistake is named at once, each with file, line and field."""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from aug3d_core.factory.config import GONE, SceneConfig, said
from aug3d_core.factory.config import place as place_of
from aug3d_core.heads.config import HeadConfig, config_of, names
from aug3d_core.run.errors import InputError, UsageError, shown
from aug3d_core.scene_files.document import Mistake, Place, parsed
from aug3d_core.scene_files.entry import FOLDER, Origin, SceneEntry

ModelT = TypeVar("ModelT", bound=BaseModel)


def checked_entry(file: Path, content: bytes) -> SceneEntry:
    """Return what the file of a scene says; raises InputError naming file, line and field of every mistake."""
    entry, origin = checked(SceneEntry, file, content)
    return entry.read_from(origin)


def checked(model: type[ModelT], file: Path, content: bytes) -> tuple[ModelT, Origin]:
    """Return what a file of the registry says, and where; raises InputError naming file, line and field of every mistake.

    model: with the fields `preset` and `settings` of a scene, and others.
    """
    try:
        document = parsed(_text(content))
    except Mistake as mistake:
        raise _refusal([f"{file}:{mistake.line}: {mistake.what}"]) from mistake
    # A field that is left empty is left out; photographs alone may be null on purpose.
    values = {name: value for name, value in document.values.items() if value is not None or name == "photos"}
    origin = Origin(file, document.lines)
    wrong = _wrong_settings(origin, values)
    try:
        entry = model.model_validate(values, context={FOLDER: file.parent})
    except ValidationError as error:
        raise _refusal([*_told(origin, error, model, ()), *wrong]) from error
    if wrong:
        raise _refusal(wrong)
    return entry, origin


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Mistake(content.count(b"\n", 0, error.start) + 1, "it is not text in UTF-8: save it as UTF-8") from error


def _refusal(problems: list[str]) -> InputError:
    return InputError("\n".join(problems), "mend that line" if len(problems) == 1 else "mend these lines")


def _wrong_settings(origin: Origin, values: Mapping[str, Any]) -> list[str]:
    """Say which settings their stages refuse. Whether there is such a preset, and settings at all, is told elsewhere."""
    known = {name: values[name] for name in ("preset", "settings") if name in values}
    try:
        SceneConfig.model_validate(SceneEntry(photos=None, **known).config_values())
    except ValidationError as error:
        return _told(origin, error, SceneConfig, ("settings",)) if error.title == SceneConfig.__name__ else []
    except UsageError as error:  # a head that there is not: its settings are not known either
        place = ("settings", "training", "head")
        return [f"{origin.file}:{origin.line(place)}: {'.'.join(place)}: {error.problem}: {error.remedy}"]
    return []


def _told(origin: Origin, errors: ValidationError, model: type[BaseModel], above: Place) -> list[str]:
    """Say what pydantic found, one line for each field, in the order of the file."""
    whats: dict[tuple[int, str], list[str]] = defaultdict(list)
    for error in errors.errors(include_url=False):
        loc = tuple(map(str, error["loc"]))
        place = (*above, *place_of(loc))
        line, name = origin.line(place), ".".join(place)
        if error["type"] == "missing":
            whats[line, name].append(f"is missing: {_fields(loc, model)[loc[-1]].description}")
        elif error["type"] == "extra_forbidden":
            whats[line, name].append(_unknown(loc, model))
        else:  # where several kinds of value are taken, pydantic adds the kind to the place
            whats[line, f"{'.'.join(origin.known(place))}{_value(error['input'])}"].append(said(error))
    return [
        f"{origin.file}:{line}: {f'{name}: ' if name else ''}{', or '.join(what)}"
        for (line, name), what in sorted(whats.items())
    ]


def _value(value: Any) -> str:
    return "" if isinstance(value, Mapping | list) else f" = {shown(value)}"


def _unknown(loc: Place, model: type[BaseModel]) -> str:
    if gone := GONE.get(".".join(loc)):
        return f"there is no such setting any more: {gone}"
    known = list(_fields(loc, model))
    near = difflib.get_close_matches(loc[-1], known, n=1)
    hint = f", did you mean {near[0]}?" if near else "."
    return f"there is no such field{hint} Known: {', '.join(known) or 'none'}"


def _fields(loc: Place, model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Return the fields beside the one that an error is about."""
    for name in loc[:-1]:
        if issubclass(model, HeadConfig) and name in names():
            model = config_of(name)
            continue
        annotation = model.model_fields[name].annotation
        model = next(a for a in (annotation, *get_args(annotation)) if isinstance(a, type) and issubclass(a, BaseModel))
    return model.model_fields
