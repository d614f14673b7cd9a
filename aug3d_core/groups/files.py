"""The files that the stages of this package write."""

from __future__ import annotations

SHARED_POINTS = "shared_points.npz"
LEFT_OUT_TABLE = "left_out.parquet"
GROUPS = "groups.npz"
SIMILARITY_PICTURE = "similarity.png"
GROUPING_MAP = "grouping.png"
