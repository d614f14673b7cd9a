"""What grouping decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from aug3d_core.groups.config import ENOUGH, GroupingConfig
from aug3d_core.groups.spare import MOST_SHOWN
from aug3d_core.run.stage import Decision
from aug3d_core.split.split import MOST_NARROWED


def decisions(metrics: Mapping[str, Any], config: GroupingConfig, notes: Sequence[str]) -> Iterator[Decision]:
    """Yield how many photographs are worth using, the size of groups, the gap around the test and the number of folds.

    A note may say why the gap is narrow.
    """
    used, gap, spare, possible = (
        metrics[name] for name in ("train_views", "gap_views", "spare_views", "spare_possible")
    )
    there, others = used + gap + spare, config.enough or ENOUGH
    yield Decision(
        field="grouping.enough",
        value=f"{there - possible} of {there}",
        measured=f"{possible} photographs outside the test show little surface that {others} others do not show",
        rule=f"one is worth using unless {others} others that stay show {MOST_SHOWN:.0%} of its surface;"
        f" {'the rest is left out' if config.enough else 'all are used'}",
        saves=f"{spare / there:.0%} of what grows with photographs" if spare else "",
    )
    photos = f"{used} training photographs"
    yield Decision(field="grouping.k", value=metrics["k"], measured=photos, rule=metrics["k_reason"])
    if (gap := metrics["gap_footprints"]) is not None:
        yield Decision(
            field="grouping.gap_footprints",
            value=round(gap, 2),
            measured=next((note for note in notes if "gap" in note), f"{config.gap_footprints} asked for"),
            rule="as wide as leaves enough to train on",
        )
    if metrics["test_reason"]:
        yield Decision(
            field="grouping.test",
            value=f"the {metrics['test_kept']} photographs of before" if metrics["test_kept"] else "chosen anew",
            measured=metrics["test_reason"],
            rule="the test of a scene that grows stays while its block holds half to twice the share asked for"
            f" ({config.test_share:.0%}) and its gap is narrowed by at most {MOST_NARROWED:.0%}",
        )
    small = "one block holds few test photographs, or training sees it"
    enough = "one block holds enough test photographs behind a gap"
    yield Decision(
        field="grouping.folds",
        value=metrics["folds"],
        measured=f"{metrics['target_views']} test photographs in this block",
        rule=small if metrics["folds"] != 1 else enough,
    )
