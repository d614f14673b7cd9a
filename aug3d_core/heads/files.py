"""The files of a trained head."""

from __future__ import annotations

MODEL_WEIGHTS = "model.safetensors"
MODEL_CONFIG = "model.json"
