"""The files that the stages of this package write."""

from __future__ import annotations

SCENE_ZARR = "scene.zarr"
LEAK_AUDIT = "leak_audit.json"
