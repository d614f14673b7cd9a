"""All studies as one page, in order: what it costs, what it gains, where it breaks, what a scene needs.

Each study leaves its part of the story beside its own page; the newest of each study, scene and size is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from urllib.parse import quote

from pydantic import Field, ValidationError

from aug3d_core.report.front_html import script
from aug3d_core.report.html import page, tag
from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.stage import Frozen
from aug3d_core.store import layout
from aug3d_core.store.store import Store

COSTS, GAINS, BREAKS, NEEDS = CHAPTERS = ("What it costs", "What it gains", "Where it breaks", "What a scene needs")
_NOTHING = {
    COSTS: "aug3d study tradeoff SCENE tells.",
    GAINS: "aug3d study tradeoff, grouping, augmentation and generalisation tell.",
    BREAKS: "aug3d study stability tells.",
    NEEDS: "aug3d study tradeoff SCENE tells.",
}


class Part(Frozen):
    """What one study adds to the story. about: the study, its scene and its size, as a title: a newer one takes its place.

    chapters: HTML by chapter. told: when, in UTC.
    """

    about: str
    chapters: dict[str, str]
    told: str = Field(default_factory=lambda: f"{datetime.now(UTC):%Y-%m-%d %H:%M:%S}")


def tell(store: Store, folder: Path, part: Part) -> Path:
    """Leave a study's part in its folder, and write the story anew; returns the story's file."""
    write_synced(folder / layout.STUDY_PART, part.model_dump_json().encode())
    parts = dict(_parts(store))
    out = store.root / layout.STUDIES / layout.STORY
    write_synced(out, _story(newest(parts), out.parent).encode())
    return out


def newest(parts: Mapping[Path, Part]) -> dict[Path, Part]:
    """Return the newest part of each study, scene and size, in the order of their names."""
    found = {part.about: (folder, part) for folder, part in sorted(parts.items(), key=lambda one: one[1].told)}
    return dict(found[about] for about in sorted(found))


def _parts(store: Store) -> Iterator[tuple[Path, Part]]:
    """Yield the folder and the part of each study; what is damaged, or of another version of aug3d, is passed over."""
    for path in (store.root / layout.STUDIES).glob(f"*/[!.]*/{layout.STUDY_PART}"):
        with suppress(ValidationError, OSError):
            yield path.parent, Part.model_validate_json(path.read_bytes())


def _story(parts: Mapping[Path, Part], root: Path) -> str:
    sections = [tag("h1", "Speed, accuracy, and where it ends"), tag("div", _contents(parts, root), class_="facts")]
    for chapter in CHAPTERS:
        told = [
            tag("h3", escape(part.about)) + part.chapters[chapter]
            for part in parts.values()
            if part.chapters.get(chapter)
        ]
        sections.append(tag("h2", chapter) + ("".join(told) or tag("p", escape(f"Not told yet: {_NOTHING[chapter]}"))))
    return page("Speed, accuracy, and where it ends - aug3d", "".join(sections), script())


def _contents(parts: Mapping[Path, Part], root: Path) -> str:
    links = (
        tag("a", escape(part.about), href=quote(str((folder / layout.STUDY_PAGE).relative_to(root))))
        + f" {escape(part.told)}"
        for folder, part in parts.items()
    )
    return "".join(tag("span", link) for link in links)
