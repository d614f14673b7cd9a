"""The record of one finished object: what made it, what it holds, what it cost and how good it is. JSON, no arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ConfigDict

from aug3d_core.run.errors import StoreError
from aug3d_core.run.stage import Decision, Frozen, Metric, State
from aug3d_core.store.seal import unsealed

_GREW = ("photos_reused", "grown_from", "test_kept")  # metrics that count what was taken from an earlier object


class FileEntry(Frozen):
    """One file of an object. Size and modification time are a quick check; the sha256 is the truth."""

    model_config = ConfigDict(extra="ignore")

    sha256: str
    size_bytes: int
    mtime_ns: int


class Record(Frozen):
    """What stands in `record.json`, written last.

    key identifies the work (code, config, inputs, engines), recipe the same without the inputs; digest identifies the
    result (paths and bytes of the files). A field that a newer version of aug3d added is passed over.
    """

    model_config = ConfigDict(extra="ignore")

    stage: str
    key: str
    digest: str
    recipe: str
    config: dict[str, Any]
    inputs: dict[str, str]  # upstream stage -> digest of its result
    modules: tuple[str, ...] = ()  # code that its settings asked for
    versions: dict[str, str]  # engine -> version
    files: dict[str, FileEntry]  # path relative to files/ -> entry
    metrics: dict[str, Metric]
    state: State
    notes: tuple[str, ...]
    series: dict[str, tuple[tuple[int, float], ...]]
    pictures: dict[str, str]
    decisions: tuple[Decision, ...] = ()  # records of before 0.7 have none
    seconds: float
    cpu_seconds: float | None = None  # of records from before 0.3: not measured
    peak_mib: float

    @property
    def size_bytes(self) -> int:
        """Bytes that the object's files occupy."""
        return sum(entry.size_bytes for entry in self.files.values())

    def named(self, reads: Mapping[str, Sequence[str]]) -> list[str]:
        """Return the files that are named for its stage. reads: stage -> names, of which some may be lacking here."""
        return [name for name in self.files if name in reads[self.stage]]

    @property
    def grew(self) -> bool:
        """Whether the object extends an earlier one, so that it cost less and may differ a little from one made anew."""
        return any(self.metrics.get(name) for name in _GREW)


def read_record(path: Path) -> Record:
    """Read a record; raises ValueError if it is not what was written."""
    return record_of(path.read_bytes())


def record_of(content: bytes) -> Record:
    """Return the record that a file holds; raises ValueError if it is not what was written."""
    record = Record.model_validate(unsealed(content))
    for name in record.files:
        if not name or any(part in ("", ".", "..") for part in name.split("/")):
            raise ValueError(f"it names a file outside its folder: {name!r}")
    if record.digest != files_digest(record.files):
        raise ValueError("the digests of its files do not fit that of the whole")
    return record


def read_job(path: Path) -> dict[str, Any]:
    """Read the job by which an object was made; raises StoreError if it is not what was written."""
    try:
        return unsealed(path.read_bytes())
    except (OSError, ValueError) as error:
        raise StoreError(f"{path} is damaged ({error})", "delete its object, and run the scene again") from error


def files_digest(files: dict[str, FileEntry]) -> str:
    """Digest of a result: every path with the sha256 of its bytes, in order; times do not enter."""
    lines = "".join(f"{path}\0{files[path].sha256}\n" for path in sorted(files))
    return hashlib.sha256(lines.encode()).hexdigest()
