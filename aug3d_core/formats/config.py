"""Configuration of the poses stage."""

from __future__ import annotations

from aug3d_core.stage import StageConfig


class PosesConfig(StageConfig):
    """Nothing to set: the kind of file is recognised, and a pose is taken as it is given or not at all."""


PRESETS: dict[str, PosesConfig] = {name: PosesConfig() for name in ("tiny", "small", "paper")}
