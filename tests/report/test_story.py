"""All studies on one page: in order, the newest of each, and what is not told yet."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.report.story import BREAKS, COSTS, GAINS, NEEDS, Part, newest, tell
from aug3d_core.store.store import Store


def part(about: str, told: str = "2026-01-01 00:00:00", **chapters: str) -> Part:
    names = {"costs": COSTS, "gains": GAINS, "breaks": BREAKS, "needs": NEEDS}
    return Part(about=about, chapters={names[k]: html for k, html in chapters.items()}, told=told)


def folder(store: Store, name: str) -> Path:
    made = store.root / "studies" / "town & sea" / name
    made.mkdir(parents=True)
    return made


def test_chapters_come_in_order_whatever_was_studied_first(tmp_path: Path) -> None:
    store = Store(tmp_path)
    tell(store, folder(store, "stability-1"), part("stability", breaks="<p>MAP</p>"))
    out = tell(store, folder(store, "tradeoff-1"), part("town: time", needs="N33DS", costs="C0STS", gains="G41NS"))
    page = out.read_text()
    assert out == tmp_path / "studies" / "story.html"
    found = [page.index(word) for word in ("C0STS", "G41NS", "<p>MAP</p>", "N33DS")]
    assert found == sorted(found)
    assert "Not told yet" not in page
    assert 'href="town%20%26%20sea/tradeoff-1/study.html"' in page


def test_a_chapter_that_nothing_tells_says_what_would(tmp_path: Path) -> None:
    store = Store(tmp_path)
    page = tell(store, folder(store, "t"), part("town", gains="x")).read_text()
    assert "Not told yet: aug3d study stability tells." in page


def test_the_newest_of_each_is_told() -> None:
    old, new = part("town", "2026-01-01 00:00:00"), part("town", "2026-01-02 00:00:00")
    other = part("beach", "2025-01-01 00:00:00")
    assert newest({Path("b"): new, Path("a"): old, Path("c"): other}) == {Path("c"): other, Path("b"): new}


def test_names_are_no_markup(tmp_path: Path) -> None:
    store = Store(tmp_path)
    page = tell(store, folder(store, "t"), part("<script>alert()</script>", gains="x")).read_text()
    assert "<script>alert()" not in page


def test_parts_that_are_damaged_or_of_another_version_are_passed_over(tmp_path: Path) -> None:
    store = Store(tmp_path)
    tell(store, folder(store, "whole"), part("town", gains="WHOLE"))
    (folder(store, "torn") / "part.json").write_text('{"about": "to')
    (folder(store, "later") / "part.json").write_text('{"about": "town", "chapters": {}, "unknown": 1}')
    tell(store, folder(store, ".damaged-aside-1"), part("town", "2027-01-01 00:00:00", gains="ASIDE"))
    page = tell(store, folder(store, "new"), part("beach", gains="NEW")).read_text()
    assert "WHOLE" in page and "NEW" in page and "ASIDE" not in page
