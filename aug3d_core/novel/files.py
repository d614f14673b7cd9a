"""The files that the stages of this package write."""

from __future__ import annotations

PREDICTION = "prediction.png"
PREDICTION_DEPTH = "depth.png"
PREDICTION_PANEL = "panel.png"
PREDICTION_VIEW = "view.json"
PREVIEW_VIEWS = "views"
PREVIEW_SHEET = "sheet.png"
PREVIEW_FLIGHT = "flight.webm"
