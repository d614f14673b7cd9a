"""Views that are in no group, and why: nothing is lost in silence."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pandas as pd
from jaxtyping import Int

from aug3d_core.groups.methods import EXCLUDED
from aug3d_core.groups.scene import GroupingScene

_NOT_CHOSEN = "every group found better members"
_NAMED = 10


def left_out(
    scene: GroupingScene, candidates: Int[np.ndarray, " m"], members: Int[np.ndarray, "c k"], method: str
) -> dict[int, str]:
    """Return the reason for each candidate that is in no group."""
    reasons = dict.fromkeys(np.setdiff1d(candidates, members).tolist(), _NOT_CHOSEN)
    if method in EXCLUDED:
        for reason, views in EXCLUDED[method](scene, candidates, members.shape[1]).items():
            reasons |= dict.fromkeys(reasons.keys() & set(views.tolist()), reason)
    return reasons


def left_out_table(reasons: dict[int, str], photo_id: Int[np.ndarray, " n"]) -> pd.DataFrame:
    """Return one row per training view that is in no group, with the reason."""
    rows = [(view, int(photo_id[view]), reason) for view, reason in sorted(reasons.items())]
    return pd.DataFrame(rows, columns=["view", "photo_id", "reason"])


def remarks(reasons: dict[int, str], photo_id: Int[np.ndarray, " n"]) -> list[str]:
    """Return a line for each reason, with the photos."""
    lines = []
    for reason, count in sorted(Counter(reasons.values()).items()):
        photos = sorted(int(photo_id[view]) for view, why in reasons.items() if why == reason)
        named = ", ".join(map(str, photos[:_NAMED])) + (", ..." if count > _NAMED else "")
        lines.append(f"{count} training views are in no group ({reason}): photos {named}")
    return lines
