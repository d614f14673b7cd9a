"""Whether two runs wrote the same files."""

from __future__ import annotations

from pathlib import Path


def assert_same_files(one: Path, other: Path) -> None:
    """Assert that two folders hold files of the same names, at least one, and of the same bytes."""
    first, second = (
        {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (one, other)
    )
    assert first and first.keys() == second.keys()
    assert not [name for name in first if first[name] != second[name]]
