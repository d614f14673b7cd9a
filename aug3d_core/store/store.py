"""The store: `objects/<stage>/<key>/` with `record.json`, `job.json`, `log.txt` and `files/`.

An object is made in `work/<stage>/<key>/` and moved into place by one rename, its record written last, so a half-written
object cannot be seen. Work folders survive a kill: a resumable stage goes on where it was.

Where several machines share a store (AUG3D_STORE), each has such a folder of its own: for what it makes, and for what it
has read of others' objects.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import ERROR, FILES, JOB, LOG
from aug3d_core.run.full_disk import disk_failure, disk_full
from aug3d_core.run.limits import cache_bytes_from
from aug3d_core.run.stage import Progress
from aug3d_core.store import layout
from aug3d_core.store.damage import DamagedError, Fault, fault, faults, listed, sha256_of, unreadable
from aug3d_core.store.private_home import make_private
from aug3d_core.store.record import FileEntry, Record, files_digest, read_record, record_of
from aug3d_core.store.seal import sealed
from aug3d_core.store.traffic import Traffic

_TOGETHER = 8  # requests at once


class Store:
    """Immutable objects under one folder. shared: what it shares with the stores of other machines, if it does."""

    def __init__(self, root: Path) -> None:
        """Open the store, and make what is missing of it; raises StoreError if it cannot be.

        One that cannot be written can be read: whoever is to change it asks `check_writable` first.
        """
        self.root = root.resolve()
        self.shared = _shared()
        self._asked: set[tuple[str, str | None]] = set()  # of whose versions the shared store was asked
        if "?" in str(self.root):
            raise StoreError(
                f"the store {self.root} has a '?' in its path, which the addresses of MLflow's database cannot hold",
                "choose another folder with --home DIR or AUG3D_HOME",
            )
        try:
            make_private(self.root)
            for folder in self._folders():
                folder.mkdir(parents=True, exist_ok=True)
            if self.shared is not None:
                self._most_cached_bytes = cache_bytes_from(os.environ, shutil.disk_usage(self.root).total)
        except OSError as error:
            if disk_full(error):
                raise disk_failure(self.root, str(error)) from error
            if self.root.is_dir() and os.access(self.root, os.R_OK | os.X_OK) and self.unwritable():
                return
            raise StoreError(
                f"the store {self.root} cannot be opened: {error.strerror}",
                "choose a folder that you can write with --home DIR or AUG3D_HOME",
            ) from error

    def traffic(self) -> Traffic:
        """Return what this process has asked of the shared store so far; nothing where there is none."""
        return self.shared.bucket.tally.traffic() if self.shared is not None else Traffic()

    def bring_versions(self, top: str, scene: str | None = None, *, again: bool = False) -> None:
        """Bring the versions of a scene (None: of all) here that other machines have made, and what is published.

        The shared store is asked once, or `again`. top: the folder of the scenes, or of the collections.
        """
        if self.shared is None or (not again and {(top, scene), (top, None)} & self._asked):
            return
        self.shared.bring_versions(self.root / top, scene)
        self._asked.add((top, scene))

    def unwritable(self) -> Path | None:
        """Return the first folder of the store that cannot be written, None if all can."""
        return next((folder for folder in self._folders() if not os.access(folder, os.W_OK)), None)

    def check_writable(self) -> None:
        """Raise StoreError that names the first folder of the store that cannot be written."""
        if folder := self.unwritable():
            raise StoreError(
                f"the store {self.root} can only be read: {folder} cannot be written",
                "make it writable, or choose another folder with --home DIR or AUG3D_HOME",
            )

    def _folders(self) -> tuple[Path, ...]:
        names = (layout.OBJECTS, layout.WORK, layout.LOCKS, layout.FAILURES, layout.SCENES)
        return (self.root, *(self.root / name for name in names))

    def object_dir(self, stage: str, key: str) -> Path:
        """Return the folder of a finished object."""
        return self.root / layout.OBJECTS / stage / key

    def files_dir(self, record: Record, reads: Sequence[str] = ()) -> Path:
        """Return the folder of an object's files to whoever reads them; raises DamagedError if one is not what was written.

        Each, or only those that are named, is compared with its digest the first time in a process.
        """
        self.check(record, reads)
        return self.place(record)

    def file(self, record: Record, name: str) -> Path:
        """Return one file of an object to whoever reads it; raises DamagedError if it is not what was written."""
        return self.files_dir(record, [name]) / name

    def place(self, record: Record) -> Path:
        """Return the folder of an object's files to be told or linked, not to be read."""
        return self.object_dir(record.stage, record.key) / FILES

    def check(self, record: Record, reads: Sequence[str] = ()) -> None:
        """Compare an object's files, or those named, with their digests; a damaged object is put aside, DamagedError raised.

        What another machine made is brought here first.
        """
        self._bring(record, reads or list(record.files))
        if self.shared is not None:
            self.shared.use(self.object_dir(record.stage, record.key))
        found = self.faults(record, reads)
        if not found:
            return
        aside = self.put_aside(record, found[0])
        where = f"it lies in {aside} now, until aug3d gc" if aside else "it could not be put aside"
        raise DamagedError(
            f"{self.place(record) / found[0].name} {found[0].what}: {record.stage} {record.key} is damaged; {where}",
            "aug3d verify --repair makes it again, and so does the next run of the scene",
            aside,
        )

    def faults(
        self, record: Record, reads: Sequence[str] = (), on_bytes: Callable[[int], None] = lambda count: None
    ) -> list[Fault]:
        """Return what is wrong with an object's files, or with those named. on_bytes: told what was read, from threads.

        Files of another machine's object that were not brought here are not missing.
        """
        entries = {name: record.files[name] for name in reads} if reads else self._here(record)
        return faults(self.place(record), entries, on_bytes)

    def work_dir(self, stage: str, key: str) -> Path:
        """Return the folder in which an object is being made."""
        return self.root / layout.WORK / stage / key

    def failure_dir(self, stage: str, key: str) -> Path:
        """Return the folder that keeps the job and log of the last failed try."""
        return self.root / layout.FAILURES / stage / key

    @contextmanager
    def lock(self, stage: str, key: str, timeout_s: float = -1.0) -> Iterator[None]:
        """Hold the right to make an object. The operating system frees it when the holder dies."""
        self.check_writable()
        try:
            with FileLock(self._lock_file(stage, key), timeout=timeout_s):
                yield
        except Timeout as error:
            raise StoreError(f"another process is making {stage} {key}", "wait for it, or end it") from error

    def being_made(self, stage: str, key: str) -> bool:
        """Say whether somebody holds the right to make an object; nothing is written for that."""
        try:
            with self._lock_file(stage, key).open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except FileNotFoundError:
            return False
        except BlockingIOError:
            return True
        return False

    def _lock_file(self, stage: str, key: str) -> Path:
        return self.root / layout.LOCKS / f"{stage}-{key}.lock"

    @contextmanager
    def using(self) -> Iterator[None]:
        """Keep what is in the store from being dropped: runs, studies and readers of files hold this, any number at once.

        Waits while something is being dropped. The operating system ends it when the holder dies.
        """
        file = self.root / layout.LOCKS / layout.IN_USE
        if self.unwritable() and not file.exists():  # nothing was ever dropped here, and nobody can drop anything
            yield
            return
        with file.open("rb" if self.unwritable() else "ab") as held:
            fcntl.flock(held, fcntl.LOCK_SH)
            yield
        self._trim()

    def _trim(self) -> None:
        """Keep within the bound what is here of the shared store, unless someone is using it."""
        if self.shared is None or self.unwritable():
            return
        from aug3d_core.store.cache import trim

        with suppress(StoreError), self.alone():
            trim(self.root, self.shared, self._most_cached_bytes)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the right to drop objects; raises StoreError while anyone uses the store."""
        self.check_writable()
        with (self.root / layout.LOCKS / layout.IN_USE).open("ab") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise StoreError(
                    f"a run, a study or a prediction is using the store {self.root}",
                    "wait until it has ended, then try again: it may need what would go",
                ) from error
            yield

    @contextmanager
    def turn(self, stage: str, progress: Progress) -> Iterator[None]:
        """Wait until no other object of a stage is being made in this store, and hold that right."""
        lock = FileLock(self.root / layout.LOCKS / f"{stage}.turn.lock")
        with suppress(Timeout):
            lock.acquire(timeout=0)
        if not lock.is_locked:
            progress(0, 1, f"waiting for another scene's {stage}")
            lock.acquire()
        try:
            yield
        finally:
            lock.release()

    def find(self, stage: str, key: str) -> Record | None:
        """Return the record of a complete, unaltered object; None if there is none. Nothing on the disk is changed.

        Raises StoreError where the disk does not let us tell.
        """
        record = self.record(stage, key)
        if not isinstance(record, Record):
            return None
        changed = any(_changed(self.place(record) / name, entry) for name, entry in self._here(record).items())
        return None if changed else record

    def whole(self, stage: str, key: str) -> Record | None:
        """Return an object's record if all its files are what was written, None otherwise; nothing on the disk is changed.

        None, too, where other machines should have the object and have not: `take` gives it to them.
        """
        record = self.record(stage, key)
        if not isinstance(record, Record) or self.faults(record):
            return None
        if self.shared is None or (self.shared.is_shared(self.object_dir(stage, key)) and self.shared.keep(stage, key)):
            return record
        return None

    def put_aside(self, record: Record, seen: Fault) -> Path | None:
        """Move a damaged object out of sight and return where it lies; None if somebody else did, or the disk forbids it."""
        with suppress(OSError, StoreError), self.lock(record.stage, record.key):
            if fault(self.place(record) / seen.name, record.files[seen.name]):  # nobody made it again meanwhile
                return self._aside(record.stage, record.key)
        return None

    def take(self, stage: str, key: str) -> tuple[Record | None, str]:
        """Return an object's record, all files compared with their digests, and what is wrong with it, "" if nothing.

        What is damaged, or left of an object, is put out of sight: only for whoever holds the object's lock.
        """
        found = self.record(stage, key)
        record, wrong = (found, self.faults(found)) if isinstance(found, Record) else (None, [found])
        if record and not wrong and self._went(stage, key):
            wrong = self.faults(record)  # all files should be here, to be shared again
        if record and not wrong:
            return self._agreed(record), ""
        if not self.object_dir(stage, key).exists():
            return record, ""
        self._aside(stage, key)
        return record, listed(wrong)

    def record(self, stage: str, key: str) -> Record | Fault:
        """Return an object's record, another machine's too, or what is wrong with it."""
        folder = self.object_dir(stage, key)
        if self.shared is not None and not folder.exists() and os.access(self.root / layout.OBJECTS, os.W_OK):
            self.shared.bring_record(stage, key, folder)
        try:
            return read_record(folder / layout.RECORD)
        except (FileNotFoundError, NotADirectoryError):
            return Fault(layout.RECORD, "is missing")
        except ValueError as error:
            return Fault(layout.RECORD, f"is damaged ({error})")
        except OSError as error:
            raise unreadable(folder, error) from error

    def _went(self, stage: str, key: str) -> bool:
        """Say whether the shared store had an object, and has it no more; it is not taken for shared then."""
        folder = self.object_dir(stage, key)
        if self.shared is None or not self.shared.is_shared(folder) or self.shared.keep(stage, key):
            return False
        self.shared.forget(folder)
        return True

    def share_again(self, items: Iterable[tuple[str, str]]) -> None:
        """See that the shared store has objects, which are about to be named, as they are here.

        One that went meanwhile is shared again; raises DamagedError where not all of it is here, or where another machine
        has made it anew with other bytes.
        """
        if self.shared is not None:
            with ThreadPoolExecutor(_TOGETHER) as pool:
                list(pool.map(lambda item: self._share_again(*item), items))

    def _share_again(self, stage: str, key: str) -> None:
        assert self.shared is not None
        folder = self.object_dir(stage, key)
        try:
            content = (folder / layout.RECORD).read_bytes()
        except FileNotFoundError:  # whoever reads what is named sees that
            return
        if self.shared.keep(stage, key) and self.shared.holds(stage, key, content):
            return
        with self.lock(stage, key):
            self.shared.forget(folder)
            ours, wrong = self.take(stage, key)
        if wrong or ours is None or ours.digest != record_of(content).digest:
            raise DamagedError(
                f"{stage} {key} is no more in the shared store as it was used here",
                "run the scene again: it is made again",
                None,
            )

    def let_go(self, stage: str, key: str) -> None:
        """Learn that the shared store has an object no more: if all of it is here it is shared again, else put aside."""
        if self.shared is not None and self.object_dir(stage, key).exists():
            with self.lock(stage, key):
                self.shared.forget(self.object_dir(stage, key))
                self.take(stage, key)

    def _aside(self, stage: str, key: str) -> Path:
        folder = self.object_dir(stage, key)
        aside = folder.with_name(f"{layout.DAMAGED}{key}-{time.time_ns()}")
        folder.rename(aside)
        return aside

    def made_by(self, stage: str, recipe: str, most: int, before: Record | None = None) -> list[Path]:
        """Return the files' folders of the whole objects that a recipe made, newest first: of those that are all here.

        before: one that comes before all others if it is among them: many scenes have the same recipe.
        """
        found = []
        for path in (self.root / layout.OBJECTS / stage).glob(f"[!.]*/{layout.RECORD}"):
            with suppress(OSError, ValueError):
                if (record := read_record(path)).recipe == recipe:
                    found.append((path.stat().st_mtime_ns, record))
        first = before.key if before and before.stage == stage else ""
        found.sort(key=lambda each: (each[1].key == first, each[0]), reverse=True)
        chosen = [record for _, record in found[:most]]
        return [self.place(record) for record in chosen if not faults(self.place(record), record.files)]

    def commit(self, work: Path, stage: str, key: str, record_fields: dict) -> Record:
        """Turn a work folder into an object: digest the files, write the record last, sync, rename."""
        files = {p.relative_to(work / FILES).as_posix(): p for p in _files_under(work / FILES)}
        entries = {name: file_entry(path) for name, path in sorted(files.items())}
        record = Record(stage=stage, key=key, digest=files_digest(entries), files=entries, **record_fields)
        write_synced(work / layout.RECORD, sealed(record.model_dump(mode="json")))
        target = self.object_dir(stage, key)
        target.parent.mkdir(parents=True, exist_ok=True)
        # Where another machine was first, and its record came here
        if self.shared is not None and self.shared.is_shared(target):
            shutil.rmtree(work)
            return read_record(target / layout.RECORD)
        work.rename(target)
        _sync_folder(target.parent)
        return self._agreed(record)

    @contextmanager
    def lease(self, stage: str, key: str, progress: Progress) -> Iterator[bool]:
        """Hold the right of this machine, of those that share the store, to make an object; yield False if one has."""
        if self.shared is None:
            yield True
            return
        from aug3d_core.store.lease import lease

        shared = self.shared

        def waiting(host: str) -> None:
            progress(0, 1, f"waiting for {host}, which makes it")

        with lease(shared.bucket, f"{stage}/{key}", lambda: shared.has_record(stage, key), waiting) as ours:
            yield ours

    @contextmanager
    def claim(self, cell: str) -> Iterator[bool]:
        """Hold a cell of a study, and yield True; or yield False if another process, or machine, is at it."""
        name = hashlib.sha256(cell.encode()).hexdigest()[:32]
        lock = FileLock(self._lock_file("cell", name))
        with suppress(Timeout):
            lock.acquire(timeout=0)
        if not lock.is_locked:
            yield False
            return
        try:
            with self._claimed(f"cells/{name}") as ours:
                yield ours
        finally:
            Path(lock.lock_file).unlink(missing_ok=True)
            lock.release()

    def _claimed(self, name: str) -> AbstractContextManager[bool]:
        if self.shared is None:
            return nullcontext(True)
        from aug3d_core.store.lease import claim

        return claim(self.shared.bucket, name)

    @contextmanager
    def handing_over(self, stage: str, key: str, shards: Sequence[str], helped: bool) -> Iterator[Callable[[], float]]:
        """Go on with what another machine left of an object, and leave to others what is made of it here meanwhile.

        helped: take also what others make of it meanwhile. Yields what tells how much that cost them [processor s].
        """
        if self.shared is None or not shards:
            yield lambda: 0.0
            return
        from aug3d_core.store.hand_over import handing_over

        files = self.work_dir(stage, key) / FILES
        with handing_over(self.shared.bucket, f"{stage}/{key}", files, shards, helped) as others_spent:
            yield others_spent

    @contextmanager
    def helping(self, stage: str, key: str, shards: Sequence[str]) -> Iterator[Callable[[float], None]]:
        """Take part in an object that another machine makes. Yields what tells it the cost of that [processor s]."""
        assert self.shared is not None, "another machine makes it"
        from aug3d_core.store.hand_over import helping

        with helping(self.shared.bucket, f"{stage}/{key}", self.work_dir(stage, key) / FILES, shards) as tell_spent:
            yield tell_spent

    def _bring(self, record: Record, names: Sequence[str]) -> None:
        """Bring files of an object here that another machine made."""
        folder = self.object_dir(record.stage, record.key)
        if self.shared is None or (
            not folder.exists() and not self.shared.bring_record(record.stage, record.key, folder)
        ):
            return
        if self.shared.is_shared(folder):
            missing = [name for name in names if not (folder / FILES / name).exists()]
            try:
                self.shared.bring_files(folder / FILES, {name: record.files[name] for name in missing})
            except StoreError:
                if not self.shared.has_record(record.stage, record.key):
                    raise self._dropped(record) from None
                raise

    def _dropped(self, record: Record) -> DamagedError:
        """Put out of sight what is here of an object that the shared store has no more; return the error that tells."""
        aside = None
        with suppress(OSError, StoreError), self.lock(record.stage, record.key):
            aside = self._aside(record.stage, record.key)
        return DamagedError(
            f"{record.stage} {record.key} was dropped from the shared store",
            "run the scene again: it is made again",
            aside,
        )

    def _here(self, record: Record) -> dict[str, FileEntry]:
        """Return the files of an object that should be in this folder: all, or those brought of another machine's."""
        if self.shared is None or not self.shared.is_shared(self.object_dir(record.stage, record.key)):
            return record.files
        return {name: entry for name, entry in record.files.items() if os.path.lexists(self.place(record) / name)}

    def _agreed(self, record: Record) -> Record:
        """Share an object of this machine; return its record, or that of another machine's where there was one first.

        Only for whoever holds the object's lock.
        """
        folder = self.object_dir(record.stage, record.key)
        if self.shared is None or self.shared.is_shared(folder) or self.shared.share(folder, record):
            return record
        discard(folder)
        theirs = self.record(record.stage, record.key)
        if isinstance(theirs, Fault):
            raise StoreError(f"the record of {record.stage} {record.key} {theirs.what}", "run the scene again")
        return theirs

    def keep_failure(self, work: Path, stage: str, key: str, *, resumable: bool) -> Path:
        """Put job and log of a failed try where the user can replay it; return that folder, the work folder on a full disk.

        Partial files stay only if the next try can go on with them. They go first: the disk may be full of them.
        """
        if not resumable:
            shutil.rmtree(work / FILES, ignore_errors=True)
        kept = self.failure_dir(stage, key)
        try:
            kept.mkdir(parents=True, exist_ok=True)
            for name in (JOB, LOG, ERROR):
                if (work / name).exists():
                    shutil.copyfile(work / name, kept / name)
        except OSError as error:
            if not disk_full(error):
                raise
            return work
        if not resumable:
            shutil.rmtree(work, ignore_errors=True)
        return kept


def _shared():
    url = os.environ.get(layout.SHARED_VARIABLE, "").strip()
    if not url:
        return None
    from aug3d_core.store.shared import shared_at

    return shared_at(url, os.environ.get("AWS_ENDPOINT_URL"), os.environ.get("AWS_ACCESS_KEY_ID"))


def file_entry(path: Path) -> FileEntry:
    """Hash one file and flush it to the disk."""
    digest = sha256_of(path)
    with path.open("rb") as file:
        os.fsync(file.fileno())
        stat = os.fstat(file.fileno())
    return FileEntry(sha256=digest, size_bytes=stat.st_size, mtime_ns=stat.st_mtime_ns)


def _changed(path: Path, entry: FileEntry) -> str:
    """Return what is wrong with a file at a glance: one of unchanged size and time is read by whoever needs it."""
    with suppress(OSError):  # `fault` says what it is
        stat = path.stat()
        if (stat.st_size, stat.st_mtime_ns) == (entry.size_bytes, entry.mtime_ns):
            return ""
    return fault(path, entry)


def _files_under(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file())


def discard(folder: Path) -> None:
    """Take a folder out of sight before it is deleted: a delete that is cut short must not leave one that looks whole."""
    gone = folder.with_name(f"{layout.GONE}{folder.name}-{os.getpid()}")
    folder.rename(gone)
    shutil.rmtree(gone)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
