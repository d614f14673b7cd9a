"""The files that the stages of this package write."""

from __future__ import annotations

MESH = "mesh.ply"
BASELINE_MESH = "baseline_mesh.ply"
BASELINE_RENDERS = "baseline_renders"
TEXTURED_MESH = "mesh_textured.npz"
MESH_TEXTURE = "mesh_texture.png"
BASELINE_TEXTURED_MESH = "baseline_mesh_textured.npz"
BASELINE_MESH_TEXTURE = "baseline_mesh_texture.png"
MESH_SOURCES = "mesh_sources.json"
PIECES = "pieces"  # while the stage works
