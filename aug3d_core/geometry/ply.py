"""Vertex-coloured triangle meshes as plain arrays, and their file: a binary PLY whose bytes depend on the arrays alone.

Only this one layout is read back (little endian; x y z float32, red green blue uchar; triangles as `uchar int` lists):
it is what `save` writes, and every viewer and engine opens it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.run.regular_file import content

_VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
_FACE = np.dtype([("corners", "u1"), ("index", "<i4", 3)])


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh in the world frame with one sRGB colour per vertex."""

    xyz: Float[np.ndarray, "v 3"]
    rgb: UInt8[np.ndarray, "v 3"]
    triangles: Int[np.ndarray, "t 3"]

    def save(self, path: Path) -> None:
        """Write the mesh; coordinates are kept as float32."""
        vertices = np.empty(len(self.xyz), _VERTEX)
        vertices["xyz"], vertices["rgb"] = self.xyz, self.rgb
        faces = np.empty(len(self.triangles), _FACE)
        faces["corners"], faces["index"] = 3, self.triangles
        with path.open("wb") as file:
            file.write(_header(len(vertices), len(faces)))
            file.write(vertices.tobytes())
            file.write(faces.tobytes())

    def colour_at(self, triangle: Int[np.ndarray, " p"], weights: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Return the colours (0 to 255) at barycentric places, linear between the corners."""
        return np.einsum("pk,pkc->pc", weights, self.rgb[self.triangles[triangle]].astype(np.float32))

    @classmethod
    def load(cls, path: Path) -> Mesh:
        """Read what `save` wrote; raises ValueError on any other layout and on a truncated file."""
        data = content(path)
        end = data.find(b"end_header\n") + len(b"end_header\n")
        counts = [int(line.split()[-1]) for line in data[:end].splitlines() if line.startswith(b"element ")]
        if len(counts) != 2 or data[:end] != _header(*counts):
            raise ValueError(f"{path.name} is not a vertex-coloured triangle mesh as aug3d writes it")
        if len(data) != end + counts[0] * _VERTEX.itemsize + counts[1] * _FACE.itemsize:
            raise ValueError(f"{path.name} is truncated: {counts[0]} vertices and {counts[1]} triangles do not fit")
        vertices = np.frombuffer(data, _VERTEX, counts[0], end)
        faces = np.frombuffer(data, _FACE, counts[1], end + vertices.nbytes)
        return cls(vertices["xyz"].copy(), vertices["rgb"].copy(), faces["index"].copy())


def _header(vertices: int, faces: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {vertices}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property uchar {channel}" for channel in ("red", "green", "blue")]
    lines += [f"element face {faces}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode("ascii")
