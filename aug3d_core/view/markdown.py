"""Words of others in the Markdown of the page, which viser renders with all HTML that is in it."""

from __future__ import annotations

import re
from string import punctuation

from aug3d_core.run.errors import Aug3dError

_MARKS = re.compile(f"([{re.escape(punctuation)}])")


def literal(text: str) -> str:
    """Return Markdown that shows a text as it is, on one line: a photograph's name may be HTML that runs a script."""
    return _MARKS.sub(r"\\\1", " ".join(text.split()))


def told(error: Exception) -> str:
    """Return an error as Markdown: what is wrong and what to do, or its name and words if it is of a library."""
    if isinstance(error, Aug3dError):
        return literal(f"{error.problem}: {error.remedy}")
    return literal(f"{type(error).__name__}: {error}")
