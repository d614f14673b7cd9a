"""The files that the stages of this package write."""

from __future__ import annotations

TEST_VIEWS = "test_views.parquet"
PANELS = "panels"
FLYTHROUGH = "flythrough.webm"
COMPARED = "compared"  # by photograph, what was predicted and what is true, at full size
CONVENTIONS = "conventions.json"


def prediction_of(photo: str) -> str:
    """Return where the prediction of a photograph is, by its `image_name`."""
    return f"{COMPARED}/predicted_{photo}"


def mask_of(photo: str) -> str:
    """Return where the mask of a photograph is, at the size of its prediction; there is none where all of it is used."""
    return f"{COMPARED}/mask_{photo}"


def truth_of(photo: str) -> str:
    """Return where a photograph is, at the size of its prediction."""
    return f"{COMPARED}/{photo}"
