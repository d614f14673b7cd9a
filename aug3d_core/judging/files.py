"""The files that the stages of this package write."""

from __future__ import annotations

TEST_VIEWS = "test_views.parquet"
PANELS = "panels"
FLYTHROUGH = "flythrough.webp"
CONVENTIONS = "conventions.json"
