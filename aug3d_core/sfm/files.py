"""The files that the stages of this package write."""

from __future__ import annotations

FEATURES = "features.db"
MATCHING_TABLE = "matching.parquet"
VIEWS = "views.npz"
VIEW_IMAGES = "images"
VIEW_MASKS = "masks"  # of the views that have one, beside their images
POINTS = "points.npz"
TRACKS = "tracks.npz"
WORLD = "world.json"
FALLOFF = "falloff.json"
CONTROL_POINTS = "control_points.parquet"  # there if the photographs have ground control points
COLMAP_MODEL = "model"
COMPONENTS = "components.json"
OTHER_MODELS = "other_models"
UNPLACED = "unplaced.parquet"
SFM_MAP = "map.png"
