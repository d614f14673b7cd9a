"""Configuration of the poses stage."""

from __future__ import annotations

from aug3d_core.run.stage import StageConfig


class PosesConfig(StageConfig):
    """No settings: the file format is recognised, and poses are used unchanged."""


PRESETS: dict[str, PosesConfig] = {name: PosesConfig() for name in ("tiny", "small", "paper")}
