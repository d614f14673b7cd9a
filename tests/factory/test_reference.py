"""The generated reference: types, bounds, units, presets and nested choices, from a small model."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import Field

from aug3d_core.factory import reference
from aug3d_core.factory.reference import settings_tables, table
from aug3d_core.factory.stages import STAGES
from aug3d_core.run.stage import Frozen


class Small(Frozen):
    name: Literal["small"] = "small"
    hidden: int = Field(default=4, ge=1, le=9, description="Width | of layers [units].")


class Large(Frozen):
    name: Literal["large"] = "large"
    rate: float = Field(default=0.5, gt=0, description="Rate.")


class Training(Frozen):
    steps_s: int | None = Field(default=None, description="Time of training [s].")
    head: Annotated[Small | Large, Field(discriminator="name")] = Small()


class Scene(Frozen):
    training: Training = Field(description="Training.")


def rows(preset: str, is_open: tuple[str, ...] = ()) -> list[str]:
    schema, values = Scene.model_json_schema(), Scene(training=Training()).model_dump() | {"auto": is_open}
    tables = settings_tables(schema["$defs"], schema["properties"]["training"], "training", {preset: values})
    return "\n".join(tables).splitlines()


def test_a_row_has_type_bounds_unit_value_and_meaning() -> None:
    assert "| `steps_s` | integer or none | s | none | Time of training. |" in rows("tiny")
    assert "| `hidden` | integer ≥ 1, ≤ 9 | units | 4 | Width \\| of layers. |" in rows("tiny")


def test_each_choice_of_nested_settings_has_a_table() -> None:
    assert {"### training.head: Small", "### training.head: Large"} <= set(rows("tiny"))
    assert "| `rate` | number > 0 |  | - | Rate. |" in rows("tiny"), "the preset has the other head"


def test_what_the_scene_decides_is_marked() -> None:
    assert any("`hidden`" in row and "*scene*" in row for row in rows("auto", ("training.head.hidden",)))


def test_a_stage_may_be_described_as_its_settings_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """A schema leaves out a field's description where the docstring of its model is the same."""

    class Town(Frozen):
        __doc__ = STAGES["town"].description

    class Scene(Frozen):
        town: Town = Field(default=Town(), description=STAGES["town"].description)

    monkeypatch.setattr(reference, "SceneConfig", Scene)
    monkeypatch.setattr(reference, "scene_config", lambda _: Scene())
    assert f"## town\n\n{STAGES['town'].description}\n" in reference.settings_page()


def test_a_table_has_as_many_columns_as_its_head() -> None:
    assert table(("a", "b"), [("1", "2|3")]).splitlines() == ["| a | b |", "| --- | --- |", "| 1 | 2\\|3 |"]
