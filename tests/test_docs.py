"""The documents: links resolve, the README is short, generated pages are up to date, examples run."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from aug3d_core.dataset.writer import arrays_of, write
from aug3d_core.factory.reference import pages
from aug3d_core.factory.stages import FROM_PHOTOS, STAGES
from aug3d_core.town.exact.declared import EXACT_TOWN
from tests.toy_scene import toy_scene

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted((*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")))
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_CODE = re.compile(r"```.*?```", re.DOTALL)
_EXAMPLE = re.compile(r"```python\n(.*?)```", re.DOTALL)


def anchors(document: Path) -> set[str]:
    """Return the anchors of a document's headings, as GitHub makes them."""
    text = _CODE.sub("", document.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def test_the_costs_of_many_scenes_count_the_stages_that_there_are() -> None:
    assert f"O = {len(FROM_PHOTOS)} stages" in (ROOT / "docs" / "scale.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ["concepts.md", "home_folder.md"])
def test_the_tables_that_are_kept_by_hand_have_every_stage(page: str) -> None:
    rows = re.findall(r"^\| `?(\w+)`? \|", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.MULTILINE)
    assert not {*STAGES, EXACT_TOWN.name} - {*rows}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_relative_links_resolve(document: Path) -> None:
    for link in _LINK.findall(_CODE.sub("", document.read_text(encoding="utf-8"))):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = document.parent / name if name else document
        assert target.exists(), f"{document.name}: {link} does not exist"
        if anchor:
            assert anchor in anchors(target), f"{document.name}: {link} names no heading"


def test_every_picture_and_page_is_linked() -> None:
    links = {
        (document.parent / link.partition("#")[0]).resolve()
        for document in DOCUMENTS
        for link in _LINK.findall(document.read_text(encoding="utf-8"))
    }
    assert not {path for path in (ROOT / "docs").iterdir() if path.resolve() not in links}


def test_the_readme_has_1200_words_at_most() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 1200  # as `wc -w` counts


@pytest.mark.parametrize("name", pages())
def test_generated_pages_are_up_to_date(name: str) -> None:
    written = (ROOT / "docs" / name).read_text(encoding="utf-8")
    assert written == pages()[name], "run python -m aug3d_core.factory.reference docs"


def test_the_example_of_the_data_set_format_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = toy_scene(0, 11, 7)
    write(scene, tmp_path / "scene.zarr", shard_views=16)
    page = (ROOT / "docs" / "dataset_format.md").read_text(encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["example", str(tmp_path / "scene.zarr")])
    exec(_EXAMPLE.findall(page)[0], {})
    assert f"{scene.images.shape} target {scene.groups['test'][0, 0]}" in capsys.readouterr().out


def test_every_array_of_the_data_set_is_described() -> None:
    page = (ROOT / "docs" / "dataset_format.md").read_text(encoding="utf-8")
    assert not [name for name in arrays_of(toy_scene(0, 11, 7)) if f"| `{name}` |" not in page]
