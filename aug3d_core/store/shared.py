"""What several machines share: objects and versions in a bucket, each put once, whole before it can be seen.

`blobs/<sha256>` holds the bytes of files, `objects/<stage>/<key>/record.json` names them: blobs first, the record last and
only if there is none. `scenes/<scene>/<version>/` holds a version, its `metrics.json` last. The home of each machine is its
own: it holds what that machine made and what it has read.
"""

from __future__ import annotations

import math
import os
import shutil
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import FILES, JOB, LOG
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket, Entry
from aug3d_core.store.marks import Mark, newest_mark
from aug3d_core.store.record import FileEntry, Record, read_record

_TOGETHER = 8  # requests at once
_LOOK_S = 600.0  # between looks at the marks
_IS_SHARED = ".shared"  # in the folder of an object: the addresses of the stores that have it


class Gone(StoreError):
    """A file that a record names is not in the shared store."""


class Shared:
    """The objects and versions in a bucket."""

    def __init__(self, bucket: Bucket) -> None:
        self.bucket = bucket
        self._lock = threading.Lock()
        self._mark, self._looked_s = Mark(), -math.inf
        self._kept: set[tuple[str, str]] = set()  # a mark, and an object in it that this process uses

    def bring_record(self, stage: str, key: str, target: Path) -> bool:
        """Put record and job of an object into a folder that is not there yet, without its files; return if there is one."""
        at = f"{layout.OBJECTS}/{stage}/{key}"
        record = self.bucket.get(f"{at}/{layout.RECORD}")
        if record is None:
            return False
        part = target.with_name(f"{layout.GONE}{target.name}-{os.getpid()}")
        shutil.rmtree(part, ignore_errors=True)
        (part / FILES).mkdir(parents=True)
        (part / layout.RECORD).write_bytes(record)
        if (job := self.bucket.get(f"{at}/{JOB}")) is not None:
            (part / JOB).write_bytes(job)
        self._note(part)
        try:
            read_record(part / layout.RECORD)
            part.rename(target)
        except ValueError as error:
            raise StoreError(
                f"{self.bucket.url}/{at}/{layout.RECORD} is damaged ({error})",
                "aug3d verify --repair, then run the scene again",
            ) from error
        except OSError:  # another process has brought it meanwhile
            shutil.rmtree(part, ignore_errors=True)
        return True

    def bring_files(self, folder: Path, entries: dict[str, FileEntry]) -> None:
        """Download files into an object's folder, each whole and as its digest says; raises StoreError."""
        with ThreadPoolExecutor(_TOGETHER) as pool:
            list(pool.map(lambda item: self._bring(folder / item[0], item[1]), entries.items()))

    def share(self, folder: Path, record: Record) -> bool:
        """Put a finished object where all machines see it; return False if another machine's is there already."""
        files = {entry.sha256: folder / FILES / name for name, entry in record.files.items()}
        with ThreadPoolExecutor(_TOGETHER) as pool:
            put = pool.map(lambda item: self._put_blob(*item), files.items())
            found = [digest for digest, ours in zip(files, put, strict=True) if not ours]
        at = f"{layout.OBJECTS}/{record.stage}/{record.key}"
        for name in (JOB, LOG):
            if (folder / name).exists():
                self.bucket.put(f"{at}/{name}", folder / name)
        if not self.bucket.create(f"{at}/{layout.RECORD}", (folder / layout.RECORD).read_bytes()):
            return False
        for digest in self._marked().blobs.intersection(found):  # long uploads: it may go, since no record named it
            self.bucket.put(f"{layout.BLOBS}/{digest}", files[digest])
        self._note(folder)
        return True

    def keep(self, stage: str, key: str) -> bool:
        """Let an object stay, now that it is used, if someone saw that nobody needed it; return whether it is still there.

        Marks are looked at every ten minutes, and stand for an hour at least before anything goes.
        """
        mark, item = self._marked(), f"{stage}/{key}"
        if item not in mark.objects:
            return True
        if (mark.name, item) not in self._kept:
            self.bucket.put(f"{layout.USED}/{item}", b"")
            self._kept.add((mark.name, item))
        return self.has_record(stage, key)

    def holds(self, stage: str, key: str, record: bytes) -> bool:
        """Say whether the record of an object is there, and this one."""
        return self.bucket.holds(f"{layout.OBJECTS}/{stage}/{key}/{layout.RECORD}", record)

    def forget(self, folder: Path) -> None:
        """No longer take it for known that the store has an object."""
        (folder / _IS_SHARED).unlink(missing_ok=True)

    def has_record(self, stage: str, key: str) -> bool:
        """Say whether an object is there."""
        return self.bucket.has(f"{layout.OBJECTS}/{stage}/{key}/{layout.RECORD}")

    def is_shared(self, folder: Path) -> bool:
        """Say whether this machine knows that the store has an object."""
        file = folder / _IS_SHARED
        return file.exists() and self.bucket.url in file.read_text().splitlines()

    def use(self, folder: Path) -> None:
        """Note that an object is used now: what was not used for longest is first to go from this machine."""
        with suppress(OSError):  # it is being dropped, or the home can only be read
            os.utime(folder / _IS_SHARED)

    def used_ns(self, folder: Path) -> int:
        """Return when an object that the store has was used last, by the clock of this machine."""
        return (folder / _IS_SHARED).stat().st_mtime_ns

    def share_version(self, version: Path) -> None:
        """Put a version where all machines see it, unless it is there; from then on it counts for them."""
        at = f"{version.parent.parent.name}/{version.parent.name}/{version.name}"
        metrics = (version / layout.METRICS).read_bytes()
        if self.bucket.holds(f"{at}/{layout.METRICS}", metrics):
            return
        files = sorted(path.relative_to(version).as_posix() for path in version.rglob("*") if path.is_file())
        for name in sorted(set(files) - {layout.METRICS, layout.TOLD}):
            self.bucket.put(f"{at}/{name}", version / name)
        if not self.bucket.create(f"{at}/{layout.METRICS}", metrics):
            raise StoreError(
                f"another version is at {self.bucket.url}/{at}", "run again: the version gets a name of its own"
            )

    def share_study(self, study: Path) -> None:
        """Put what a study found, and which objects it names, where all machines see it."""
        findings = study / layout.STUDY_FINDINGS
        self.bucket.put(self._of(findings), findings)

    def share_pointer(self, pointer: Path, content: bytes) -> None:
        """Put the pointer to a published version where all machines see it; the last one counts."""
        self.bucket.put(f"{pointer.parent.parent.name}/{pointer.parent.name}/{pointer.name}", content)

    def bring_versions(self, top: Path, scene: str | None = None) -> None:
        """Bring the versions of a scene, or of all, that this machine lacks, and what is published.

        A version is here by its `metrics.json`; its report comes when it is asked for.
        """
        found: list[Path] = []
        for entry in self.bucket.entries(f"{top.name}/{scene}/" if scene else f"{top.name}/"):
            parts = entry.name.split("/")
            if any(part in ("", ".", "..") for part in parts):
                continue
            if len(parts) == 3 and parts[2] == layout.PUBLISHED:
                self._bring_pointer(entry, top / parts[1] / parts[2])
            elif len(parts) == 4 and parts[3] == layout.METRICS and not (top / parts[1] / parts[2]).exists():
                found.append(top / parts[1] / parts[2])
        with ThreadPoolExecutor(_TOGETHER) as pool:
            list(pool.map(self._bring_version, found))

    def bring_report(self, version: Path) -> None:
        """Download the report of a version that this machine lacks, if there is one."""
        report = version / layout.REPORT
        if not report.exists() and (content := self.bucket.get(self._of(report))) is not None:
            write_synced(report, content)

    def _bring_version(self, target: Path) -> None:
        content = self.bucket.get(self._of(target / layout.METRICS))
        if content is None:  # it was deleted meanwhile
            return
        part = target.with_name(f"{layout.GONE}{target.name}-{os.getpid()}")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        (part / layout.METRICS).write_bytes(content)
        (part / layout.TOLD).touch()
        try:
            part.rename(target)
        except OSError:  # another process has brought it meanwhile
            shutil.rmtree(part, ignore_errors=True)

    @staticmethod
    def _of(file: Path) -> str:
        """Return the name of a file of a version in the bucket."""
        return "/".join(file.parts[-4:])

    def _bring_pointer(self, entry: Entry, target: Path) -> None:
        if target.exists() and entry.surely_holds(target.read_bytes()):
            return
        if content := self.bucket.get(entry.name):
            target.parent.mkdir(parents=True, exist_ok=True)
            part = target.with_name(f".{target.name}.{os.getpid()}")
            part.write_bytes(content)
            part.replace(target)

    def _marked(self) -> Mark:
        with self._lock:
            if time.monotonic() - self._looked_s > _LOOK_S:
                self._mark, self._looked_s = newest_mark(self.bucket), time.monotonic()
            return self._mark

    def _put_blob(self, digest: str, file: Path) -> bool:
        """Put the bytes of a file unless they are there to stay; return whether they were put."""
        name = f"{layout.BLOBS}/{digest}"
        if digest not in self._marked().blobs and self.bucket.has(name):
            return False
        self.bucket.put(name, file)
        return True

    def _bring(self, file: Path, entry: FileEntry) -> None:
        part = file.with_name(f".{file.name}.{os.getpid()}")
        part.parent.mkdir(parents=True, exist_ok=True)
        try:
            digest = self.bucket.download(f"{layout.BLOBS}/{entry.sha256}", part)
        except FileNotFoundError as error:
            part.unlink(missing_ok=True)
            raise Gone(
                f"{file.name} is gone from {self.bucket.url} ({layout.BLOBS}/{entry.sha256})",
                "aug3d verify --repair, then run the scene again",
            ) from error
        if digest != entry.sha256:
            part.unlink()
            raise StoreError(
                f"{self.bucket.url}/{layout.BLOBS}/{entry.sha256} holds other bytes than its name says ({file.name})",
                "aug3d verify --repair, then run the scene again",
            )
        os.utime(part, ns=(entry.mtime_ns, entry.mtime_ns))
        part.replace(file)

    def _note(self, folder: Path) -> None:
        file = folder / _IS_SHARED
        known = file.read_text().splitlines() if file.exists() else []
        file.write_text("\n".join([*known, self.bucket.url]) + "\n")


@cache
def shared_at(url: str, endpoint: str | None, key_id: str | None) -> Shared:
    """Return the store at an address, one for each service and user."""
    return Shared(Bucket(url))
