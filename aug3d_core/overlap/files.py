"""The files that the stages of this package write."""

from __future__ import annotations

OVERLAP_TABLE = "overlap.parquet"
OVERLAP_MEMBERS = "overlap_members.parquet"
GROUPS_MAP = "groups_map.png"
GROUPS_COLUMNS = "groups_columns.jpg"
