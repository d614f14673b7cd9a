"""The files that the stage training writes besides the head's."""

from __future__ import annotations

CHECKPOINT = "checkpoint"
CURVE = "curve.parquet"
