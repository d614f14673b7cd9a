"""The code that a stage runs, down to single definitions: what its key depends on.

From the stage function every name is followed to its definition, in other modules of `aug3d_core` too. A constant, function
or class that is not reached has no effect on the digest, nor has the name or the place of a module: adding a file name or a
second model, or moving a file, computes nothing again. Comments and docstrings do not count.

Names are resolved as Python does it, from the syntax alone: nothing is imported. What the syntax cannot show, such as a
function that is named by a setting, a stage's configuration names (`StageConfig.modules`).
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

_ENTRY = re.compile(r"aug3d_core(\.\w+)+(:\w+)?")
_MODULE = "*"  # stands for a whole module, where its definitions are not named one by one
_EFFECTS = "!"  # stands for what a module does when it is imported, besides defining names


@dataclass(frozen=True)
class Node:
    """A definition: a name of a module, all of the module, or what the module does when it is imported."""

    module: str
    name: str


@dataclass(frozen=True)
class _Statement:
    """A statement of a module: its syntax, and what it uses.

    uses: (name, attribute or ""). imports: what imports inside it bind. entries: "module" or "module:name" in strings.
    """

    syntax: str
    uses: frozenset[tuple[str, str]]
    imports: Mapping[str, tuple[str, str]]
    entries: frozenset[str]


@dataclass(frozen=True)
class _Module:
    definitions: Mapping[str, Sequence[_Statement]]  # the statements that bind a name
    imports: Mapping[str, tuple[str, str]]


def code_digest(entries: Iterable[str]) -> str:
    """Hash the code that entries, "module" or "module:name", reach. The files are read again when they change."""
    return _digest(tuple(sorted(entries)))


_known: dict[tuple[str, ...], tuple[dict[Path, int], str]] = {}  # entries -> times of the files behind them, digest


def _digest(entries: tuple[str, ...]) -> str:
    times, digest = _known.get(entries, ({}, ""))
    here = {source_path(entry.partition(":")[0]) for entry in entries}
    if not here <= times.keys() or times != changed_at(times):
        found = reached(entries)
        times = changed_at({source_path(node.module) for node in found})
        digest = _hashed(json.dumps(_graph(found)))
        _known[entries] = times, digest
    return digest


def reached(entries: Iterable[str]) -> dict[Node, tuple[tuple[str, Node | str], ...]]:
    """Return every definition that entries reach, each with the names that it uses and what they stand for.

    A name stands for another definition, or for something from elsewhere, as text.
    """
    found: dict[Node, tuple[tuple[str, Node | str], ...]] = {}
    _looked.clear()
    queue = [node for entry in entries for node in _named(entry)]
    while queue:
        node = queue.pop()
        if node in found:
            continue
        found[node] = tuple(sorted(_used_by(node), key=str))
        queue.extend(target for _, target in found[node] if isinstance(target, Node))
        queue.append(Node(node.module, _EFFECTS))
    return found


def changed_at(files: Iterable[Path]) -> dict[Path, int]:
    """Return when each of the files and folders that exist was last written [ns]."""
    times = {}
    for file in files:
        with suppress(OSError):
            times[file] = file.stat().st_mtime_ns
    return times


def source_path(module: str) -> Path:
    """Return the file of a module. Nothing is imported but its top package: parents may be heavy."""
    top, *parts = module.split(".")
    path = _package_folder(top).joinpath(*parts)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _package_folder(top: str) -> Path:
    if top == "aug3d_core":
        return Path(__file__).parents[1]
    spec = find_spec(top)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(top)
    return Path(spec.submodule_search_locations[0])


def _graph(found: Mapping[Node, tuple[tuple[str, Node | str], ...]]) -> list[list[str]]:
    """Return the definitions and what their names stand for, without the names of modules."""
    syntax = {node: _hashed("\n".join(one.syntax for one in _statements_of(node))) for node in found}
    edges = {
        (syntax[node], name, syntax[target] if isinstance(target, Node) else target)
        for node, uses in found.items()
        for name, target in uses
    }
    return sorted([*map(list, edges), *([one] for one in set(syntax.values()))])


def _hashed(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _used_by(node: Node) -> Iterator[tuple[str, Node | str]]:
    """Yield the names that a definition uses, each with what it stands for."""
    if node.name == _MODULE:
        module = _module(node.module)
        names = {*module.definitions, *module.imports} - {_EFFECTS}
        yield from ((name, target) for name in names for target in _resolve(node.module, name, "", {}))
        return
    for statement in _statements_of(node):
        for name, attribute in statement.uses:
            for target in _resolve(node.module, name, attribute, statement.imports):
                yield f"{name}.{attribute}" if attribute else name, target
        for entry in statement.entries:
            yield from (("", target) for target in _named(entry))


def _resolve(module: str, name: str, attribute: str, inner: Mapping[str, tuple[str, str]]) -> Iterator[Node | str]:
    """Yield what a name stands for in a module; nothing for a builtin, a parameter or a local variable."""
    known = _module(module)
    if (bound := inner.get(name)) is None:
        if name in known.definitions:
            yield Node(module, name)
            return
        if (bound := known.imports.get(name)) is None:
            return
    source, imported = bound
    if not _followed(source, module):
        yield f"{source}:{imported}"
    elif imported and not _exists(f"{source}.{imported}"):
        yield from _resolve(source, imported, attribute, {})
    else:
        whole = f"{source}.{imported}" if imported else source
        yield from _resolve(whole, attribute, "", {}) if attribute else [Node(whole, _MODULE)]


def _named(entry: str) -> Iterator[Node]:
    """Yield what an entry, "module" or "module:name", stands for."""
    module, _, name = entry.partition(":")
    if not name:
        yield Node(module, _MODULE)
    else:
        yield from (target for target in _resolve(module, name, "", {}) if isinstance(target, Node))


def _statements_of(node: Node) -> Sequence[_Statement]:
    return _module(node.module).definitions.get(node.name, ())


def _followed(module: str, within: str) -> bool:
    """Say whether the code of a module is followed: that of aug3d, and of the package that the importing module is in."""
    return module.partition(".")[0] in ("aug3d_core", within.partition(".")[0])


@lru_cache(maxsize=4096)
def _exists(module: str) -> bool:
    return all(part.isidentifier() for part in module.split(".")) and source_path(module).is_file()


_looked: dict[str, _Module] = {}  # the modules of one look at the code: a file is asked once whether it changed


def _module(name: str) -> _Module:
    if name not in _looked:
        path = source_path(name)
        _looked[name] = _parsed(path, path.stat().st_mtime_ns)
    return _looked[name]


@lru_cache(maxsize=2048)
def _parsed(path: Path, _changed_at_ns: int) -> _Module:
    return _understood(path.read_bytes())


@lru_cache(maxsize=2048)
def _understood(source: bytes) -> _Module:
    definitions: dict[str, list[_Statement]] = {}
    imports: dict[str, tuple[str, str]] = {}
    for statement in _statements(_tree(source).body):
        if isinstance(statement, ast.Import | ast.ImportFrom):
            imports.update(_bound(statement))
            continue
        names, analysed = list(_binds(statement)) or [_EFFECTS], _analysed(statement)
        for name in names:
            definitions.setdefault(name, []).append(analysed)
    return _Module(definitions, imports)


def _tree(source: bytes) -> ast.Module:
    try:
        return ast.parse(source)
    except SystemError:  # two threads that parse at once can meet a bug of CPython 3.11 (gh-106905)
        return ast.parse(source)


def _statements(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a module without docstrings; those under `if TYPE_CHECKING` or `try` one by one."""
    for statement in body:
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue
        if isinstance(statement, ast.If):
            yield ast.copy_location(ast.Expr(statement.test), statement)
            yield from _statements([*statement.body, *statement.orelse])
        elif isinstance(statement, ast.Try):
            yield from _statements([*statement.body, *statement.orelse, *statement.finalbody])
            yield from _statements(inner for handler in statement.handlers for inner in handler.body)
        else:
            yield statement


def _binds(statement: ast.stmt) -> Iterator[str]:
    """Yield the names that a statement of a module binds; none where it does something else as well."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield statement.name
    elif isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        bound = [node for target in targets for node in ast.walk(target)]
        if all(isinstance(node, ast.Name | ast.Tuple | ast.List | ast.expr_context) for node in bound):
            yield from (node.id for node in bound if isinstance(node, ast.Name))


def _analysed(statement: ast.stmt) -> _Statement:
    reader = _Reader()
    reader.read(statement)
    return _Statement("".join(reader.syntax), frozenset(reader.uses), reader.imports, frozenset(reader.entries))


def _bound(statement: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield each name that an import binds, with the module and the name in it; "" for the module itself."""
    for alias in statement.names:
        if isinstance(statement, ast.ImportFrom):
            yield alias.asname or alias.name, (statement.module or "", alias.name)
        elif alias.asname:
            yield alias.asname, (alias.name, "")
        else:
            yield alias.name.partition(".")[0], (alias.name, "")


def _is_entry(value: object) -> bool:
    """Say whether a value is a string that names code: `[sys.executable, "-m", "aug3d_core.rendering.worker"]`."""
    return isinstance(value, str) and _ENTRY.fullmatch(value) is not None and _exists(value.partition(":")[0])


_LEFT_OUT = frozenset({ast.ImportFrom, ast.Constant, ast.Expr})  # some of these
_NOTED = frozenset({ast.Import, ast.ImportFrom, ast.Attribute, ast.Name, ast.Call})


class _Reader:
    """Reads a statement in one pass: what it uses, and its syntax without what people alone read.

    Left out are docstrings, the descriptions of settings, and the names of modules of aug3d, which say where code is and not
    what it does.
    """

    def __init__(self) -> None:
        self.syntax: list[str] = []
        self.uses: set[tuple[str, str]] = set()
        self.imports: dict[str, tuple[str, str]] = {}
        self.entries: set[str] = set()
        self._attributed: set[int] = set()  # nodes that are read as a part of an attribute

    def read(self, node: object) -> None:
        if isinstance(node, ast.AST):
            kind = type(node)  # asked first: most nodes of the syntax are of kinds that need no second look
            if kind in _LEFT_OUT and self._left_out(node):
                return
            if kind in _NOTED:
                self._note(node)
            self.syntax.append(f"({kind.__name__} ")
            for name in kind._fields:
                self.read(getattr(node, name))
            self.syntax.append(")")
        elif isinstance(node, list):
            for one in node:
                self.read(one)
            self.syntax.append("]")
        else:
            self.syntax.append(repr(node))

    def _left_out(self, node: ast.AST) -> bool:
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "aug3d_core":
            self.imports.update(_bound(node))
            return True
        if isinstance(node, ast.Constant) and _is_entry(node.value):
            self.entries.add(str(node.value))
            return True
        return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)

    def _note(self, node: ast.AST) -> None:
        if isinstance(node, ast.Import | ast.ImportFrom):
            self.imports.update(_bound(node))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            self.uses.add((node.value.id, node.attr))
            self._attributed.add(id(node.value))
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and id(node) not in self._attributed:
            self.uses.add((node.id, ""))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Field":
            node.keywords = [one for one in node.keywords if one.arg not in ("description", "title")]
