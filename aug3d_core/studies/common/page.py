"""The frame of a study's page: one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

from aug3d_core.report.html import page, tag
from aug3d_core.studies.common.publication import Publication

_MOST_OPEN = 20  # notes; more are folded away


def page_of(study: Publication, chapters: Mapping[str, str]) -> str:
    """Return the page of a study."""
    facts = "".join(tag("span", f"{name} {tag('b', escape(value))}") for name, value in study.facts.items())
    sections = [
        tag("h1", escape(study.question)),
        tag("div", facts, class_="facts"),
        study.before,
        *(tag("h2", chapter) + html for chapter, html in chapters.items()),
        study.after,
        tag("h2", "Method"),
        tag("p", escape(study.method)),
        tag("p", escape(study.cost), class_="dim"),
    ]
    return page(f"{study.title} - aug3d", "".join(sections), study.script)


def notes(found: Iterable[tuple[str, str]]) -> str:
    """Return a section with the failures and warnings of a study, each with the name of its arm or cell."""
    lines = [tag("div", f"{tag('b', escape(of))} {escape(note)}", class_="note") for of, note in dict.fromkeys(found)]
    if not lines:
        return ""
    listed = "".join(lines)
    if len(lines) > _MOST_OPEN:
        listed = tag("details", tag("summary", f"{len(lines)} notes") + listed)
    return tag("h2", "Failures and warnings") + listed
