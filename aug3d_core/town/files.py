"""The files that the stages of this package write."""

from __future__ import annotations

TOWN_PHOTOS = "photos"
TOWN_TRUTH = "truth"
TRUTH_POSES = "truth/poses.npz"
TRUTH_LENS = "truth/lens.json"
TRUTH_MESH = "truth/mesh.ply"
TRUTH_FOOTPRINTS = "truth/footprints.json"
