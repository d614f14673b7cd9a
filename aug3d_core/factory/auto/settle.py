"""Settle what a stage's settings leave open, just before it is made: the stage itself never sees that anything was open."""

from __future__ import annotations

from collections.abc import Mapping

from aug3d_core.factory.auto.decision import Known, Settled
from aug3d_core.factory.auto.rules import rule_of
from aug3d_core.factory.config import SceneConfig, left_open
from aug3d_core.factory.material import Material
from aug3d_core.run.nested import merged, nested
from aug3d_core.run.stage import Stage
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
    """Return a stage's settings with nothing left open, by what is known of the scene."""
    config = known.config
    chosen = getattr(config, stage.name)
    open_fields = left_open(config, stage.name)
    if not open_fields:
        return Settled(chosen)
    rules = [rule_of(f"{stage.name}.{field}", config.training.head.name) for field in open_fields]
    decisions = tuple(found for rule in rules if rule and (found := rule(known)))
    values = nested({found.field.partition(".")[2]: found.value for found in decisions})
    return Settled(type(chosen).model_validate(merged(chosen.model_dump(), values)), decisions)
