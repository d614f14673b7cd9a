"""JSON that carries a digest of itself: one changed bit in it is seen when it is read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SEAL = "seal"


def sealed(content: Mapping[str, Any]) -> bytes:
    """Return the text of a JSON object with its seal."""
    plain = json.loads(json.dumps(content))  # as a reader will see it: tuples are lists then
    return json.dumps({**plain, SEAL: _seal_of(plain)}, indent=1).encode()


def unsealed(text: bytes) -> dict[str, Any]:
    """Return the object without its seal; raises ValueError if it is none, or not what was written.

    What an earlier version wrote has no seal, and is taken as it is.
    """
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError("it is no JSON object")
    seal = content.pop(SEAL, None)
    if seal is not None and seal != _seal_of(content):
        raise ValueError("it is not what was written: its seal does not fit")
    return content


def _seal_of(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
