"""Settle what a stage's settings leave open, just before it is made: the stage itself never sees that anything was open."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import ValidationError

from aug3d_core.factory.auto.decision import Known, Settled
from aug3d_core.factory.auto.rules import rule_of
from aug3d_core.factory.config import SceneConfig, left_open, place
from aug3d_core.factory.material import Material
from aug3d_core.run.errors import UsageError, shown
from aug3d_core.run.nested import merged, nested
from aug3d_core.run.stage import Decision, Stage, StageConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


def settle(
    stage: Stage, config: SceneConfig, records: Mapping[str, Record], store: Store, material: Material | None = None
) -> Settled:
    """Return a stage's settings with nothing left open.

    records: what is made so far, by stage, as this stage sees it. material: what the user gave, by default nothing.
    """
    return settle_by(stage, Known(config, records, store, material or Material()))


def settle_by(stage: Stage, known: Known) -> Settled:
    """Return a stage's settings with nothing left open, by what is known of the scene.

    Raises UsageError naming the settings if the stage refuses what is decided.
    """
    config = known.config
    chosen = getattr(config, stage.name)
    open_fields = left_open(config, stage.name)
    if not open_fields:
        return Settled(chosen)
    rules = [rule_of(f"{stage.name}.{field}", config.training.head.name) for field in open_fields]
    decisions = tuple(_bounded(found, chosen) for rule in rules if rule and (found := rule(known)))
    values = nested({_path(found): found.value for found in decisions})
    try:
        return Settled(type(chosen).model_validate(merged(chosen.model_dump(), values)), decisions)
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join((stage.name, *place(e['loc'])))}={shown(e['input'])}: {e['msg'].lower()}"
            for e in error.errors(include_url=False)
        )
        raise UsageError(f"auto decided what is not valid: {wrong}", "set it by hand with --set") from error


def _bounded(found: Decision, chosen: StageConfig) -> Decision:
    """Return a decision with the nearest value that its setting may have, and say so where that is another one."""
    *above, name = _path(found).split(".")
    holder = chosen
    for part in above:
        holder = getattr(holder, part)
    value, bounds = found.value, type(holder).model_fields[name].metadata
    if not isinstance(value, int | float):
        return found
    least, most = ([getattr(one, end) for one in bounds if hasattr(one, end)] for end in ("ge", "le"))
    within = min([max([value, *least]), *most])
    if within == value:
        return found
    rule = f"{found.rule}; that would be {value:,}, and {within:,} is the bound of the setting"
    return found.model_copy(update={"value": within, "rule": rule})


def _path(found: Decision) -> str:
    """Return where in the settings of its stage a decision is."""
    return found.field.partition(".")[2]
