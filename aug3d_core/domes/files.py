"""The files that the stages of this package write."""

from __future__ import annotations

CAMERAS = "cameras.npz"
DOME_TABLE = "domes.parquet"
BUILDINGS = "buildings.npz"
BUILDINGS_MAP = "buildings.png"
SAMPLING_MAP = "map.png"
COVERAGE_CHART = "coverage.png"
