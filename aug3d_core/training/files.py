"""The files that the stages of this package write."""

from __future__ import annotations

MODEL_WEIGHTS = "model.safetensors"
MODEL_CONFIG = "model.json"
CHECKPOINT = "checkpoint"
CURVE = "curve.parquet"
