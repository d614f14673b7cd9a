"""A key changes with everything that can change a result, and with nothing else."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.factory import stages
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.run.stage import Stage
from aug3d_core.store import keys
from aug3d_core.store.code import reached
from aug3d_core.training.config import TrainingConfig
from tests.tests_support import FakeConfig, fake_stage


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(tmp_path)
    return fake_stage(tmp_path)


def key(stage, do: str = "succeed", **inputs: str) -> str:
    return keys.object_key(keys.recipe_of(stage, FakeConfig(do=do)), inputs)


def test_key_changes_with_config_inputs_and_engine(stage, monkeypatch: pytest.MonkeyPatch) -> None:
    first = key(stage, a="1")
    assert first == key(stage, a="1")
    assert len({first, key(stage, "raise", a="1"), key(stage, a="2"), key(stage, b="1")}) == 4
    monkeypatch.setattr(keys, "_version", lambda engine: "99")
    assert key(stage, a="1") != first


def test_a_build_for_gpus_is_another_engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sfm, config = stages.STAGES["sfm"], stages.STAGES["sfm"].config()
    monkeypatch.setattr(keys, "_version", lambda engine: "1")
    assert "pycolmap-cuda12" in keys.engine_versions(sfm, config) and "pycolmap" not in keys.engine_versions(
        sfm, config
    )
    monkeypatch.setattr(keys, "_version", lambda engine: "none" if engine == "pycolmap-cuda12" else "1")
    assert "pycolmap" in keys.engine_versions(sfm, config) and "pycolmap-cuda12" not in keys.engine_versions(
        sfm, config
    )


def test_a_process_that_lives_on_sees_what_is_installed_and_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    assert keys._version("an-engine") == "none"
    for release in ("1.0", "2.0"):
        told = tmp_path / f"an_engine-{release}.dist-info"
        told.mkdir()
        (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: an-engine\nVersion: {release}\n")
        assert keys._version("an-engine") == keys._version("an-engine") == release
        shutil.rmtree(told)
        assert keys._version("an-engine") == "none"


def test_key_changes_with_code_but_not_with_comments(stage, tmp_path: Path) -> None:
    first = key(stage)
    source = tmp_path / "tests_fake" / "stage.py"
    source.write_text(f'"""A docstring."""\n{source.read_text()}\n# a comment\n\nUNUSED = 1\n')
    assert key(stage) == first
    source.write_text(source.read_text().replace("1.5", "2.5"))
    os.utime(source, ns=(1, 1))  # the clock of files may not have moved on since
    assert key(stage) != first


# Distribution of a package; "" where another release of it changes neither files nor figures
DISTRIBUTIONS = {
    "flip_evaluator": "flip-evaluator",
    "PIL": "pillow", "cv2": "opencv-python-headless", "skimage": "scikit-image",
    "numpy": "",  # an engine of every stage as it is
    "jaxtyping": "", "pydantic": "", "pydantic_core": "",  # say what is given, and compute nothing
    "OpenEXR": "", "pandas": "", "pyarrow": "", "safetensors": "", "zarr": "",  # containers: what was written is read
    "matplotlib": "",  # draws for people alone
    "psutil": "",  # watches processes
    "mathutils": "",  # comes with bpy
}  # fmt: skip


def third_parties(stage: Stage) -> set[str]:
    """Return what is imported from elsewhere by all code of a stage."""
    entries = [stage.entry, *(stage.presets["tiny"].modules if stage.presets else ())]
    used = [target for uses in reached(entries).values() for _, target in uses if isinstance(target, str)]
    return {target.partition(":")[0].partition(".")[0] for target in used} - sys.stdlib_module_names


@pytest.mark.parametrize("stage", [value for value in vars(stages).values() if isinstance(value, Stage)])
def test_all_that_a_stage_computes_with_is_among_its_engines(stage: Stage) -> None:
    named = {DISTRIBUTIONS.get(package, package) for package in third_parties(stage)} - {""}
    asked = SamplingConfig(method="sam").engines if stage is stages.SAMPLING else ()
    assert named <= {*stage.engines, *asked}


def test_what_segments_photographs_counts_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keys, "_version", lambda engine: "none" if engine == "transformers" else "1")
    asked = keys.engine_versions(stages.SAMPLING, SamplingConfig(method="sam"))
    assert (asked["torch"], asked["transformers"]) == ("1", "none"), "the stage says what to install"
    assert not {"torch", "transformers"} & keys.engine_versions(stages.SAMPLING, SamplingConfig()).keys()


def test_weights_are_known_by_their_bytes(tmp_path: Path) -> None:
    training = stages.STAGES["training"]
    weights = tmp_path / "resnet34.safetensors"
    config = TrainingConfig(head=PixelNerfConfig(encoder="resnet34", encoder_weights=str(weights)))
    found = {keys.recipe_of(training, config)}
    for time_ns, content in enumerate((b"one", b"two")):
        weights.write_bytes(content)
        os.utime(weights, ns=(time_ns, time_ns))
        found.add(keys.recipe_of(training, config))
    assert (
        len(found) == 3 and not TrainingConfig(head=PixelNerfConfig(encoder="resnet34", encoder_weights="auto")).files
    )


def test_a_model_that_segments_is_known_by_its_bytes_where_it_is_a_folder(tmp_path: Path) -> None:
    folder = SamplingConfig(method="sam", sam_weights=str(tmp_path))
    assert [file.name for file in folder.files] == ["config.json", "model.safetensors"]
    (tmp_path / "config.json").write_text("{}")
    assert SamplingConfig(method="sam", sam_weights=str(tmp_path / "config.json")).files == folder.files
    assert not SamplingConfig(method="sam", sam_weights="facebook/sam-vit-base").files
    assert not SamplingConfig(method="grid", sam_weights=str(tmp_path)).files
