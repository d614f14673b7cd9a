"""The settings of a head, and how a head is found by its name. Imports no torch."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from aug3d_core.run.stage import StageConfig

DEFAULT = "sweep"
FIRST = "pixelnerf"  # the paper's; up to 0.6 the only one, and models and runs had no name of a head

Measures = Mapping[str, float]  # what one training step measured, by name
Symptom = Callable[[Measures], bool]


class HeadConfig(StageConfig):
    """Base of a head's settings.

    name: a Literal with one value, the name of the head's folder. title: what reports call it. decidable: fields that the
    preset `auto` leaves open. of_training: fields that training alone reads; a model that was saved before there was one
    is the network that it was.
    """

    title: ClassVar[str]
    decidable: ClassVar[tuple[str, ...]] = ()
    of_training: ClassVar[tuple[str, ...]] = ()
    name: str

    @property
    def pixels_per_group(self) -> int | None:
        """How many pixels of a group's targets a training step looks at; None: all of them, whole images."""
        return None

    @property
    def facts(self) -> Mapping[str, int | float | str]:
        """What tables say of the network."""
        return {}

    @property
    def modules(self) -> tuple[str, ...]:
        """The code of the head: part of the key of whatever trains or runs it."""
        return (f"aug3d_core.heads.{self.name}.head:HEAD",)


@cache
def names() -> tuple[str, ...]:
    """Return the names of all heads."""
    return tuple(sorted(file.parent.name for file in Path(__file__).parent.glob("*/config.py")))


def config_of(name: str) -> type[HeadConfig]:
    """Return the configuration model of a head; raises KeyError if there is none of this name."""
    return _module(name).CONFIG


def presets_of(name: str) -> Mapping[str, Mapping[str, Any]]:
    """Return the settings of the stage training with a head, by the name of the preset: its own, and how it is trained."""
    return _module(name).PRESETS


def usual_of(preset: str) -> str:
    """Return the head of a preset, where none is chosen: `paper` has the paper's."""
    return FIRST if preset == "paper" else DEFAULT


def shipped() -> tuple[Path, str, tuple[str, ...]]:
    """Return the folder of the model that aug3d ships, of the default head; its digest; and the code that runs it."""
    module = _module(DEFAULT)
    return module.SHIPPED, module.SHIPPED_DIGEST, module.CONFIG().modules


def title_of(name: str | None) -> str:
    """Return what reports call a head; its name if it is none of today's. Runs up to 0.6 told none: they had the first."""
    name = name or FIRST
    return config_of(name).title if name in names() else name


def _module(name: str) -> Any:
    if name not in names():
        raise KeyError(f"there is no head {name!r}: choose one of {', '.join(names())}")
    return importlib.import_module(f"aug3d_core.heads.{name}.config")


class _ByName:
    """Lets pydantic choose the configuration model by the field `name`, in checks, files and forms."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        choices = {name: handler.generate_schema(config_of(name)) for name in names()}
        return core_schema.tagged_union_schema(choices, discriminator="name")

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Prefect's form shows `anyOf`, and no `oneOf`; of one head it shows the settings at once."""
        choices = handler(schema)["oneOf"]
        return {"anyOf": choices} if len(choices) > 1 else choices[0]


AnyHead = Annotated[HeadConfig, _ByName()]
