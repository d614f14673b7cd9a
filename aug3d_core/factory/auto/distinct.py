"""Which training photographs show something of their own: more of the same need not be trained on longer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Int

from aug3d_core.geometry.views import Tracks
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import TRACKS
from aug3d_core.split.files import SPLIT_TABLE

MOST_SHOWN = 0.9  # share of a photograph's points that enough others show as well


def distinct(tracks: Tracks, candidates: Int[np.ndarray, " m"], shown_by: int) -> Int[np.ndarray, " d"]:
    """Return the views that stay when each is dropped, the most shared first, of whose points so many others show most.

    shown_by: how many of the views that stay must show a point, so that nothing depends on the view that is dropped. A view
    without points shows nothing of its own.
    """
    of_them = np.isin(tracks.view, candidates)
    pairs = np.unique(np.stack([tracks.view[of_them], tracks.point[of_them]], axis=1), axis=0)
    count = np.bincount(pairs[:, 1])
    points = {int(view): pairs[pairs[:, 0] == view, 1] for view in candidates}
    shared = {view: float(np.mean(count[seen] > shown_by)) if len(seen) else 1.0 for view, seen in points.items()}
    for view in sorted(points, key=lambda view: -shared[view]):
        seen = points[view]
        if not len(seen) or np.mean(count[seen] > shown_by) >= MOST_SHOWN:
            count[seen] -= 1
            del points[view]
    return np.array(sorted(points), int)


def training_photos(sfm: Path, grouping: Path, shown_by: int) -> tuple[int, int]:
    """Return how many training photographs there are, and how many of them are distinct, from the stages' folders."""
    split = pd.read_parquet(grouping / SPLIT_TABLE, columns=["view", "role"])
    train = split.loc[split["role"].astype(str) == "train", "view"].to_numpy(int)
    return len(train), len(distinct(Tracks.load(sfm / TRACKS), train, shown_by))


def photos_worth(sfm: Path, grouping: Path, shown_by: int) -> Decision:
    """Return how many training photographs are worth training on."""
    count, own = training_photos(sfm, grouping, shown_by)
    return Decision(
        field="grouping.distinct_photos",
        value=f"{own} of {count}",
        measured=f"{count - own} training photographs show little that {shown_by} others do not show",
        rule=f"one is distinct unless {MOST_SHOWN:.0%} of its points are shown by {shown_by} others that stay, as many as the"
        " model is given; all are used, but auto lets steps, width and virtual views grow with the distinct ones only",
        saves=f"{1 - own / count:.0%} of what grows with photographs" if own < count else "",
    )
