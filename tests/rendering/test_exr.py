import struct

import numpy as np
import pytest

from aug3d_core.rendering.exr import read_exr

HEIGHT, WIDTH = 3, 5


def attribute(name: str, kind: str, value: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def exr(images: dict[str, np.ndarray], version: int = 2, compression: int = 0, pixel_type: int = 2) -> bytes:
    """Write the format by the book."""
    channels = b"".join(n.encode() + b"\0" + struct.pack("<iB3xii", pixel_type, 0, 1, 1) for n in images) + b"\0"
    header = struct.pack("<II", 20000630, version)
    header += attribute("channels", "chlist", channels) + attribute("compression", "compression", bytes([compression]))
    header += attribute("dataWindow", "box2i", struct.pack("<4i", 0, 0, WIDTH - 1, HEIGHT - 1)) + b"\0"
    row_bytes = 4 * WIDTH * len(images)
    start = len(header) + 8 * HEIGHT
    table = b"".join(struct.pack("<Q", start + y * (row_bytes + 8)) for y in range(HEIGHT))
    rows = [struct.pack("<ii", y, row_bytes) + b"".join(i[y].tobytes() for i in images.values()) for y in range(HEIGHT)]
    return header + table + b"".join(rows)


@pytest.fixture
def images():
    rng = np.random.default_rng(0)
    return {
        name: rng.normal(size=(HEIGHT, WIDTH)).astype("<f4") for name in ("V.Combined.A", "V.Combined.R", "V.Depth.Z")
    }


def test_channels_come_back_as_written(tmp_path, images):
    (tmp_path / "a.exr").write_bytes(exr(images))
    found, attributes = read_exr(tmp_path / "a.exr")
    assert attributes["compression"] == b"\0"
    assert list(found) == list(images)
    for name, image in images.items():
        np.testing.assert_array_equal(found[name], image)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"version": 2 | 0x1000}, "single-part"), ({"compression": 3}, "compressed"), ({"pixel_type": 1}, "32-bit")],
)
def test_other_kinds_are_refused(tmp_path, images, change, message):
    (tmp_path / "a.exr").write_bytes(exr(images, **change))
    with pytest.raises(ValueError, match=message):
        read_exr(tmp_path / "a.exr")
