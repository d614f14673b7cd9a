"""A folder of files that people edit, one for each scene or collection: `<folder>/<name>.yaml`."""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import Aug3dError, InputError, UsageError
from aug3d_core.run.regular_file import content
from aug3d_core.store import layout
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.store import Store

_PATIENCE_S = 10.0
_MOST_BYTES = 2**20  # of a file that people write
EntryT = TypeVar("EntryT")


@dataclass(frozen=True)
class Registry(Generic[EntryT]):
    """Files of one kind. what: what one of them is of, in words; command: how they are made and removed."""

    folder: str
    what: str
    command: str
    checked: Callable[[Path, bytes], EntryT]
    written: Callable[[str, EntryT], str]

    def read(self, store: Store, name: str) -> EntryT:
        """Return what a file says.

        Raises UsageError if there is none, InputError naming file, line and field if it says something wrong.
        """
        return self.read_file(self.file(store, name))

    def read_each(self, store: Store) -> dict[str, EntryT | Aug3dError]:
        """Return what every file says, or what is wrong with it: one bad file does not hide the others."""
        found: dict[str, EntryT | Aug3dError] = {}
        for files in self._by_name(store).values():
            try:
                found[files[0].stem] = self.read_file(self._only(files))
            except Aug3dError as error:
                found[files[0].stem] = error
        return found

    def file(self, store: Store, name: str) -> Path:
        """Return the file of a name; raises UsageError if there is none, InputError if there are two."""
        by_name = self._by_name(store)
        files = by_name.get(check_scene_name(name).casefold(), [])
        if files and name in [file.stem for file in files]:
            return self._only(files)
        known = [files[0].stem for files in by_name.values()]
        near = difflib.get_close_matches(name, known, n=1)
        raise UsageError(
            f"there is no {self.what} {name!r} in the registry {store.root / self.folder}",
            f"did you mean {near[0]}?" if near else f"known: {', '.join(known) or 'none yet'}; see {self.command} add",
        )

    def add(self, store: Store, name: str, entry: EntryT) -> Path:
        """Write a new file and return it; raises UsageError if there is one, which stays as it is."""
        file = store.root / self.folder / f"{check_scene_name(name)}{layout.SCENE_FILES[0]}"
        with self.alone(store):
            if files := self._by_name(store).get(name.casefold()):
                raise UsageError(
                    f"there is a {self.what} {files[0].stem!r} already: {files[0]}",
                    f"edit that file, remove the {self.what} with {self.command} remove, or choose another name",
                )
            file.parent.mkdir(exist_ok=True)
            write_synced(file, self.written(name, entry).encode())
        return file

    def remove(self, store: Store, name: str) -> Path:
        """Remove a file and return where it was; what was made by it stays."""
        with self.alone(store):
            file = self.file(store, name)
            file.unlink()
        return file

    def read_file(self, file: Path) -> EntryT:
        """Return what a file says."""
        try:
            check_scene_name(file.stem)
            return self.checked(file, content(file, _MOST_BYTES))
        except UsageError as error:
            raise InputError(f"{file}: {error.problem}", f"give the file another name: {error.remedy}") from error
        except OSError as error:
            raise InputError(f"{file} cannot be read: {error.strerror}", "make it a file that you can read") from error

    @contextmanager
    def alone(self, store: Store) -> Iterator[None]:
        """Let one process at a time change the files."""
        with store.lock(self.folder, "registry", _PATIENCE_S):
            yield

    def files(self, store: Store) -> list[Path]:
        """Return all files, right or wrong."""
        folder = store.root / self.folder
        found = sorted(folder.iterdir()) if folder.is_dir() else []
        return [file for file in found if file.suffix in layout.SCENE_FILES and not file.name.startswith(".")]

    def _by_name(self, store: Store) -> dict[str, list[Path]]:
        """Return the files of each name; upper and lower case are one name, as they are on many disks."""
        by_name: dict[str, list[Path]] = defaultdict(list)
        for file in self.files(store):
            by_name[file.stem.casefold()].append(file)
        return by_name

    def _only(self, files: list[Path]) -> Path:
        if len(files) > 1:
            raise InputError(
                f"{len(files)} files name one {self.what}: {' and '.join(map(str, files))}",
                "keep one of them, or give one another name; upper and lower case are one name",
            )
        return files[0]
