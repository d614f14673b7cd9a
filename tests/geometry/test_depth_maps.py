from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.depth_maps import read_map, write_map
from aug3d_core.run.errors import InputError


@given(st.integers(1, 9), st.integers(1, 9), st.sampled_from([1, 3]), st.integers(0, 2**32 - 1))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, width: int, height: int, channels: int, seed: int
) -> None:
    shape = (height, width) if channels == 1 else (height, width, channels)
    values = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    path = tmp_path_factory.mktemp("map") / "a.bin"
    write_map(path, values)
    np.testing.assert_array_equal(read_map(path), values)


def test_the_bytes_are_those_that_colmap_reads(tmp_path: Path) -> None:
    values = np.array([[[1, 5], [2, 6]], [[3, 7], [4, 8]]], np.float32)  # (y, x, channel)
    write_map(tmp_path / "a.bin", values)
    data = (tmp_path / "a.bin").read_bytes()
    assert data.startswith(b"2&2&2&")
    np.testing.assert_array_equal(np.frombuffer(data[6:], "<f4"), [1, 2, 3, 4, 5, 6, 7, 8])


@pytest.mark.parametrize("data", [b"", b"2&2&", b"2&2&1&" + b"\0" * 12, b"a&b&c&" + b"\0" * 16])
def test_a_damaged_map_is_named(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.bin").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.bin is no whole depth or normal map"):
        read_map(tmp_path / "a.bin")
