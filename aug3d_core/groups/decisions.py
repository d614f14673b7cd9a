"""What grouping decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.run.stage import Decision


def decisions(metrics: Mapping[str, Any], config: GroupingConfig, notes: Sequence[str]) -> Iterator[Decision]:
    """Yield the size of groups, the gap around the test and the number of folds. A note may say why the gap is narrow."""
    photos = f"{metrics['train_views']} training photographs"
    yield Decision(field="grouping.k", value=metrics["k"], measured=photos, rule=metrics["k_reason"])
    if (gap := metrics["gap_footprints"]) is not None:
        yield Decision(
            field="grouping.gap_footprints",
            value=round(gap, 2),
            measured=next((note for note in notes if "gap" in note), f"{config.gap_footprints} asked for"),
            rule="as wide as leaves enough to train on",
        )
    small = "one block holds few test photographs, or training sees it"
    enough = "one block holds enough test photographs behind a gap"
    yield Decision(
        field="grouping.folds",
        value=metrics["folds"],
        measured=f"{metrics['target_views']} test photographs in this block",
        rule=small if metrics["folds"] != 1 else enough,
    )
