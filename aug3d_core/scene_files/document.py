"""YAML as values, with the line of everything in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import yaml

_PLAIN = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "map", "seq")}
_LONGEST_NUMBER = 300  # digits; more do not fit into a float
Place = tuple[str, ...]  # of a value: the keys that lead to it
_HINTS = {
    "'\\t'": "indent with spaces, not with tabs",
    "alias": 'a value that begins with * needs quotes, as in cron: "*/30 * * * *"',
    "mapping values": "a text with a colon in it needs quotes, and each field a line of its own",
    "quoted scalar": "a quotation mark is missing",
}


class _Loader(yaml.SafeLoader):
    """Values without tags alone, and a date is a text like others: there is no field for dates."""

    yaml_implicit_resolvers: ClassVar = {
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Refuse a tag, also one of YAML's own: a value that is not what its tag says comes without a line."""
        event = self.peek_event()
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent) and event.tag is not None:
            raise yaml.MarkedYAMLError(
                problem=f"the tag {event.tag} is not read: leave it out", problem_mark=event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Give what is no number the line that it stands in: `0x_` looks like one."""
        try:
            return super().construct_object(node, deep)
        except ValueError as error:
            raise yaml.MarkedYAMLError(problem=str(error), problem_mark=node.start_mark) from error


class Mistake(Exception):
    """What cannot be read, and in which line (from 1)."""

    def __init__(self, line: int, what: str) -> None:
        super().__init__(f"line {line}: {what}")
        self.line = line
        self.what = what


@dataclass(frozen=True)
class Document:
    """What a file says, and in which line (from 1) each key and list item stands."""

    values: dict[Any, Any]
    lines: dict[Place, int]


def parsed(text: str) -> Document:
    """Read a YAML mapping; raises Mistake. Two equal keys and references are mistakes too."""
    root = composed(text)
    lines: dict[Place, int] = {}
    for place, line in _places(root, ()):
        if place in lines:
            raise Mistake(line, f"there is {'.'.join(place)} twice: it is in line {lines[place]} already")
        lines[place] = line
    try:
        return Document(_Loader("").construct_document(root), lines)
    except yaml.MarkedYAMLError as error:
        raise _mistake(error) from error


def composed(text: str) -> yaml.MappingNode:
    """Return the nodes of a YAML mapping, with their marks; raises Mistake."""
    try:
        root = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        raise _mistake(error) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise Mistake(line, f"the character {chr(error.character)!r} cannot stand here") from error
    except RecursionError as error:
        raise Mistake(1, "it is nested too deeply") from error
    if not isinstance(root, yaml.MappingNode):
        raise Mistake(1, "it holds no fields: write `name: value` in each line")
    return root


def _places(node: yaml.Node, place: Place) -> Iterator[tuple[Place, int]]:
    """Yield the place and line of everything below a node, in order."""
    seen: set[int] = set()
    below = [(place, node)]
    while below:
        place, node = below.pop()
        if id(node) in seen:
            raise Mistake(_line(node.start_mark), "a reference (& and *) cannot be followed here: write the value out")
        seen.add(id(node))
        if node.tag not in _PLAIN:
            raise Mistake(_line(node.start_mark), f"the tag {node.tag} makes no plain value: leave it out")
        if node.tag.endswith(":int") and len(node.value) > _LONGEST_NUMBER:
            raise Mistake(_line(node.start_mark), f"a number of {len(node.value)} characters is too large")
        parts: list[tuple[str, yaml.Node, yaml.Node]] = []
        if isinstance(node, yaml.MappingNode):
            parts = [(str(key.value), key, value) for key, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            parts = [(str(i), item, item) for i, item in enumerate(node.value)]
        for name, key, value in parts:
            yield (*place, name), _line(key.start_mark)
            below.append(((*place, name), value))


def _mistake(error: yaml.MarkedYAMLError) -> Mistake:
    said = f"{error.context or ''} {error.problem or ''}"
    hint = next((f" ({hint})" for sign, hint in _HINTS.items() if sign in said), "")
    mark = error.problem_mark or error.context_mark
    begun = error.context_mark
    since = f", {error.context}" + (f" begun in line {_line(begun)}" if begun else "") if error.context else ""
    return Mistake(_line(mark) if mark else 1, f"{error.problem}{since}{hint}")


def _line(mark: yaml.Mark) -> int:
    return mark.line + 1
