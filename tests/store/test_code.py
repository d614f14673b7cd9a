"""A stage's code is every definition that it reaches, and nothing else."""

from __future__ import annotations

import os
import shutil
import textwrap
from pathlib import Path

import pytest

import aug3d_core
from aug3d_core.factory.stages import FROM_TOWN, RENDERING, SFM
from aug3d_core.store import code
from aug3d_core.store.code import Node, code_digest, reached


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the sources, which digests are now taken of."""
    folder = tmp_path / "aug3d_core"
    shutil.copytree(Path(aug3d_core.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    real = code._package_folder
    monkeypatch.setattr(code, "_package_folder", lambda top: folder if top == "aug3d_core" else real(top))
    monkeypatch.setattr(code, "_known", {})
    return folder


def digests() -> dict[str, str]:
    return {stage.name: code_digest([stage.entry, *stage.presets["tiny"].modules]) for stage in FROM_TOWN}


def changed(before: dict[str, str]) -> set[str]:
    return {name for name, digest in digests().items() if digest != before[name]}


def append(path: Path, text: str) -> None:
    path.write_text(f"{path.read_text()}\n\n{textwrap.dedent(text)}")


def test_a_new_file_name_in_every_package_changes_no_stage(copy: Path) -> None:
    before, files = digests(), sorted(copy.rglob("files.py"))
    for path in files:
        append(path, 'NEW_PICTURE = "new.png"\n')
    assert len(files) > 15 and changed(before) == set()


def test_another_file_name_changes_the_stages_that_use_it(copy: Path) -> None:
    before, files = digests(), copy / "surface" / "files.py"
    files.write_text(files.read_text().replace('"baseline_mesh.ply"', '"other_mesh.ply"'))
    found = changed(before)
    assert "surface" in found and not found & {"town", "photos", "matching", "sfm", "depth", "training"}


def test_a_setting_of_the_prediction_changes_no_stage_of_a_run(copy: Path) -> None:
    before = digests()
    head, field = "class PredictionConfig(StageConfig):", "    sharpness: float = 1.0\n"
    (config,) = (path for path in copy.rglob("config.py") if head in path.read_text())
    config.write_text(config.read_text().replace(head, f"{head}\n{field}"))
    assert changed(before) == set()


def test_a_second_head_changes_no_stage(copy: Path) -> None:
    before = digests()
    shutil.copytree(copy / "heads" / "pixelnerf", copy / "heads" / "another")
    assert changed(before) == set()


def test_the_code_of_a_head_changes_what_it_trains_alone(copy: Path) -> None:
    before, network = digests(), copy / "heads" / "sweep" / "network.py"
    network.write_text(network.read_text().replace("_BEYOND = 1.5", "_BEYOND = 2.5"))
    assert changed(before) == {"training"}, "what runs a trained head has its code from the training's record"


def test_a_move_changes_nothing(copy: Path) -> None:
    before = digests()
    shutil.copytree(copy / "geometry", copy / "algebra")
    shutil.rmtree(copy / "geometry")
    for source in copy.rglob("*.py"):
        source.write_text(source.read_text().replace("aug3d_core.geometry", "aug3d_core.algebra"))
    assert changed(before) == set()


def test_words_for_people_change_nothing(copy: Path) -> None:
    before, config = digests(), copy / "sfm" / "config.py"
    text = config.read_text().replace('description="', 'description="In other words: ')
    config.write_text(f"# a comment\n{text}")
    assert config.read_text().count("In other words") > 3 and changed(before) == set()


def test_arithmetic_changes_all_that_use_it_at_any_remove(copy: Path) -> None:
    before, transforms = digests(), copy / "geometry" / "transforms.py"
    assert "def invert(" in transforms.read_text()
    transforms.write_text(transforms.read_text().replace("def invert(", "def invert(extra=None, *, ", 1))
    found = changed(before)
    assert {"town", "sfm", "depth", "dataset"} <= found and "photos" not in found


def test_what_a_module_does_when_it_is_imported_counts(copy: Path) -> None:
    before = digests()
    append(copy / "sfm" / "config.py", "print('imported')\n")
    assert {"matching", "sfm"} <= changed(before) and "photos" not in changed(before)


def test_a_worker_process_is_code_of_its_stage() -> None:
    assert Node("aug3d_core.rendering.worker", "main") in reached([RENDERING.entry])


def test_a_stage_reaches_no_list_of_stages() -> None:
    found = {node.module for node in reached([SFM.entry])}
    assert "aug3d_core.geometry.views" in found
    assert not any(name.startswith(("aug3d_core.factory", "aug3d_core.store", "aug3d_core.heads")) for name in found)


def test_names_are_followed_through_packages_aliases_and_functions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    package = tmp_path / "followed"
    package.mkdir()
    sources = {
        "__init__": "from followed.inner import deep as shallow",
        "inner": "LEVEL = 2\nOTHER = 3\ndef deep(): return LEVEL\ndef unused(): return OTHER",
        "entry": """
            import followed.inner as whole
            from followed import shallow as renamed
            try:
                from followed.inner import OTHER
            except ImportError:
                OTHER = None
            def run():
                from followed.late import late
                return renamed() + whole.LEVEL + late()
        """,
        "late": "def late(): return 1",
    }
    for name, text in sources.items():
        (package / f"{name}.py").write_text(textwrap.dedent(text))
    found = {f"{node.module}:{node.name}" for node in reached(["followed.entry:run"])}
    assert {"followed.inner:deep", "followed.inner:LEVEL", "followed.late:late"} <= found
    assert not found & {"followed.inner:unused", "followed.inner:OTHER"}
    first = code_digest(["followed.entry:run"])
    (package / "inner.py").write_text(textwrap.dedent(sources["inner"]).replace("OTHER = 3", "OTHER = 4"))
    os.utime(package / "inner.py", ns=(1, 1))  # the clock of files may not have moved on since
    assert code_digest(["followed.entry:run"]) == first
    (package / "inner.py").write_text(textwrap.dedent(sources["inner"]).replace("LEVEL = 2", "LEVEL = 5"))
    assert code_digest(["followed.entry:run"]) != first
