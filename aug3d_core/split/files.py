"""The table of roles that a split leaves: which view is for what."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

SPLIT_TABLE = "split.parquet"


def read_roles(grouping: Path, views: int) -> np.ndarray:
    """Return the role of each view, (views,) of str, from the grouping stage's output; empty for one that has none."""
    table = pd.read_parquet(grouping / SPLIT_TABLE)
    role = np.full(views, "", dtype=object)
    role[table["view"].to_numpy()] = table["role"].astype(str).to_numpy()
    return role
