"""One changed bit in sealed JSON is seen, or changes nothing that is read."""

from __future__ import annotations

import json

import pytest

from aug3d_core.store.seal import SEAL, sealed, unsealed

CONTENT = {"scene": "town", "psnr": 21.25, "steps": [1, 2.5, None, True], "nested": {"ö": "x\ny"}, "nan": 1e-300}


def test_what_was_sealed_is_read() -> None:
    assert unsealed(sealed(CONTENT)) == CONTENT
    assert SEAL in json.loads(sealed(CONTENT))


def test_every_single_flipped_bit_is_seen_or_harmless() -> None:
    text, seen = bytearray(sealed(CONTENT)), 0
    for bit in range(8 * len(text)):
        text[bit // 8] ^= 1 << bit % 8
        try:
            found = unsealed(bytes(text))
        except ValueError:
            seen += 1
        else:  # white space, or the name of the seal itself
            assert {name: value for name, value in found.items() if name in CONTENT} == CONTENT
        text[bit // 8] ^= 1 << bit % 8
    assert seen > 0.8 * 8 * len(text)


def test_what_an_earlier_version_wrote_has_no_seal() -> None:
    assert unsealed(b'{"scene": "town"}') == {"scene": "town"}


@pytest.mark.parametrize("text", [b"", b"[1]", b"{", b'"text"', b"\xff"])
def test_what_is_no_object_is_refused(text: bytes) -> None:
    with pytest.raises(ValueError):
        unsealed(text)
