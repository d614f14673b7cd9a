"""What OpenCV does for depth. The checks run in a process of their own: other tests here load pycolmap."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

_PREAMBLE = """
import numpy as np
from aug3d_core.depth.cameras import Camera
from aug3d_core.depth.coherence import filled, without_islands
from aug3d_core.depth.normals import normals_of
from aug3d_core.depth.job import PhotoTask
from aug3d_core.depth.search import families_for, ranges_for
from aug3d_core.depth.sweep import Photo, Reference, better_half
from aug3d_core.geometry.transforms import look_at
"""

CHECKS = {
    "small pieces go and large ones stay": """
depth = np.zeros((40, 40), np.float32)
depth[:10, :10] = 50
depth[20:23, 20:23] = 50
kept = without_islands(depth, 40)
assert (kept[:10, :10] == 50).all() and not kept[20:23, 20:23].any()
""",
    "a piece that stands out of its surroundings is a piece of its own": """
depth = np.full((40, 40), 50, np.float32)
depth[20:23, 20:23] = 45
assert not without_islands(depth, 40)[20:23, 20:23].any()
""",
    "a slope hangs together over any height": """
depth = np.repeat(np.linspace(30, 60, 200, dtype=np.float32)[None], 5, axis=0)
assert (without_islands(depth, 500) > 0).all()
""",
    "an empty map stays empty": """
assert not without_islands(np.zeros((5, 5), np.float32), 4).any()
""",
    "holes are filled and nothing else is": """
fine, coarse = np.full((4, 4), 9, np.float32), np.full((2, 2), 7, np.float32)
fine[2:, 2:] = 0
both = filled(fine, coarse)
assert (both[2:, 2:] == 7).all() and (both[:2] == 9).all()
""",
    "correlation does not mind exposure": """
grey = np.random.default_rng(0).integers(60, 120, (50, 60)).astype(np.uint8)
same = Reference(grey).correlation((grey * 2 + 10).astype(np.uint8), np.s_[0:50, 0:60])
assert same.min() > 0.95
""",
    "correlation is nothing beyond the image and small on a featureless field": """
grey = np.full((50, 60), 100, np.uint8)
warped = grey.copy()
warped[:, :20] = 0
score = Reference(grey).correlation(warped, np.s_[0:50, 0:60])
assert (score[:, :20] == -1).all() and np.abs(score[:, 30:]).max() < 1e-3
""",
    "what is left out of a warp would have shown nothing": """
from aug3d_core.depth import sweep as at_work
rng = np.random.default_rng(3)
def photo(eye, target, size=(96, 72)):
    camera = Camera(look_at(np.array(eye), np.array(target)), np.array([80.0, 80.0, size[0] / 2, size[1] / 2]), *size)
    return Photo(rng.integers(1, 256, size[::-1]).astype(np.uint8), camera)

reference = photo([0.0, 0.0, 40.0], [0.0, 3.0, 0.0])
sources = [
    photo([15.0, 0.0, 40.0], [15.0, 0.0, 0.0]), photo([0.0, 60.0, 40.0], [0.0, 0.0, 0.0]),
    photo([70.0, 0.0, 20.0], [0.0, 0.0, 0.0]), photo([0.0, 5.0, 35.0], [30.0, 90.0, 35.0]),
    photo([400.0, 0.0, 40.0], [400.0, 0.0, 0.0], (60, 80)),
]
normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]])
families = [at_work.Family(normal, 1 / np.linspace(60, 2, 20)) for normal in normals]
some, places = at_work.sweep(reference, sources, families), []
whole = at_work._part

def all_of_it(to_source, source, camera):
    rows, columns = whole(to_source, source, camera)
    places.append((rows.stop - rows.start) * (columns.stop - columns.start) / (camera.width * camera.height))
    return slice(0, camera.height), slice(0, camera.width)

at_work._part = all_of_it
everything = at_work.sweep(reference, sources, families)
at_work._part = whole
assert np.abs(some.score - everything.score).max() < 0.02, "but for the rounding of places to parts of a pixel"
assert (some.depth == everything.depth).mean() > 0.99
assert np.mean(places) < 0.75 and min(places) == 0 and max(places) == 1, places
""",
    "an occluded half of the sources does not count": """
good, bad = np.full((2, 2), 0.9, np.float32), np.full((2, 2), -0.3, np.float32)
assert np.allclose(better_half([good, bad, good, bad]), 0.9)
assert np.allclose(better_half([bad, good]), 0.9)
""",
    "a place that one source sees scores a little less than one that all see": """
good, none = np.full((2, 2), 0.9, np.float32), np.full((2, 2), -1, np.float32)
assert 0.8 < better_half([good, none, none, none])[0, 0] < 0.9
""",
    "planes are level for a nadir view, face an oblique one too, and only face a camera below the roofs": """
def planes_of(target, height, slab):
    task = PhotoTask(view=0, sources=(1,), others=(1,), depth=(20, 60), height=slab)
    photos = []
    for x in (0.0, 5.0):
        pose = look_at(np.array([x, 0, height]), np.array([x, *target]))
        camera = Camera(pose, np.array([50.0, 50.0, 32.0, 24.0]), 64, 48)
        photos.append(Photo(np.random.default_rng(0).integers(1, 255, (48, 64)).astype(np.uint8), camera))
    ranges = ranges_for(photos[0], photos[1:], task, 2.0)
    families_for(photos[0].camera, [photos[1].camera], ranges, 2.0)
    world = photos[0].camera.cam_from_world[:, :3]
    return [tuple(np.round(world.T @ each.normal, 6) + 0.0) for each in ranges]

down = (0, 0, -1)
assert planes_of((0.1, 0.0), 40.0, (0.0, 8.0)) == [down]
oblique = planes_of((40.0, 0.0), 40.0, (0.0, 8.0))
assert oblique[0] == down and np.allclose(oblique[1], (0, 0.5**0.5, -(0.5**0.5)))
assert np.allclose(planes_of((40.0, 2.0), 2.0, (0.0, -8.0)), [(0, 1, 0)])
""",
    "the normal of a tilted plane is exact": """
camera = Camera(look_at(np.array([0, 0, 40.0]), np.array([5, 3, 0.0])), np.array([100.0, 110.0, 61.0, 50.0]), 128, 96)
truth = np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])
depth = (-40 / (camera.rays @ truth)).astype(np.float32)
found = normals_of(depth, camera)
assert np.degrees(np.arccos(np.clip(found @ truth, -1, 1))).max() < 0.2
""",
    "where there is no depth there is no normal": """
camera = Camera(look_at(np.array([0, 0, 40.0]), np.zeros(3)), np.array([100.0, 100.0, 8.0, 8.0]), 16, 16)
depth = np.full((16, 16), 40, np.float32)
depth[3] = 0
found = normals_of(depth, camera)
assert not found[3].any() and found[4].any(axis=-1).all()
""",
}


_ALL = """
import json, sys, traceback
told = {}
for name, check in json.load(sys.stdin).items():
    try:
        exec(check, {})
        told[name] = ""
    except Exception:
        told[name] = traceback.format_exc()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told() -> dict[str, str]:
    """Return what each check that failed said, and nothing of the others."""
    checks = json.dumps({name: _PREAMBLE + check for name, check in CHECKS.items()})
    done = subprocess.run([sys.executable, "-c", _ALL], input=checks, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("check", CHECKS)
def test_opencv(check: str, told: dict[str, str]) -> None:
    assert not told[check], told[check]
