"""Segment Anything with random weights: the model is small, the way through it is the real one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from aug3d_core.domes.methods import METHODS, sam
from aug3d_core.domes.orthographic import Slice
from aug3d_core.run.errors import InputError
from tests.engines.little_town import config, site_over, town
from tests.engines.sam_forks import SamForks

pytestmark = pytest.mark.slow  # torch and transformers start twice
installed = pytest.mark.skipif(
    find_spec("transformers") is None, reason="transformers (the extra sam) is not installed"
)


@pytest.fixture(scope="module")
def forks() -> Iterator[SamForks]:
    """Return a process of its own for torch, which must not share one with the ray caster."""
    with SamForks() as process:
        yield process


@pytest.fixture(scope="module")
def weights(forks: SamForks, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("weights")
    forks.make_weights(folder)
    return folder


@pytest.fixture
def quick(forks: SamForks, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork each worker from a process that has imported all that it needs."""
    monkeypatch.setattr(sam, "run_worker", forks.run_worker)


def everything_built(rgb: np.ndarray) -> Slice:
    shape = rgb.shape[:2]
    return Slice(np.ones(shape), 0.5, np.ones(shape, bool), 4.0)


def picture() -> np.ndarray:
    rgb = np.full((48, 80, 3), 90, np.uint8)
    rgb[10:30, 20:50] = (200, 120, 90)
    return rgb


@installed
@pytest.mark.usefixtures("quick")
def test_outlines_come_from_the_model_and_are_the_same_each_time(weights: Path) -> None:
    rgb = picture()
    piece = everything_built(rgb)
    mask = sam.outlines(rgb, piece, str(weights), True)
    assert mask.shape == rgb.shape[:2] and mask.dtype == bool and mask.any()
    np.testing.assert_array_equal(mask, sam.outlines(rgb, piece, str(weights), True))


@installed
@pytest.mark.usefixtures("quick")
def test_what_is_not_built_is_left_out(weights: Path) -> None:
    rgb = picture()
    piece = replace(everything_built(rgb), built=np.zeros(rgb.shape[:2], bool))
    assert not sam.outlines(rgb, piece, str(weights), True).any()


@installed
def test_the_method_plans_domes(weights: Path) -> None:
    """This one by a worker as the product starts it."""
    surface, site = site_over(town(tower=4.0))
    ground, coarse = site.ground, np.s_[2::4, 2::4]  # each of a thousand outlines is as large as the raster
    rgb = np.full_like(ground.rgb[coarse], 128)
    ground = replace(ground, height=ground.height[coarse], rgb=rgb, square=4 * ground.square)
    answer = METHODS["sam"](
        surface, replace(site, ground=ground), config(sam_weights=str(weights)), np.random.default_rng(0)
    )
    assert answer.buildings is not None and len(answer.cameras) > 0


@installed
@pytest.mark.usefixtures("quick")
def test_weights_of_another_kind_are_refused(weights: Path, tmp_path: Path) -> None:
    (tmp_path / "config.json").write_bytes((weights / "config.json").read_bytes())
    save_file({"weight": np.zeros(3, np.float32)}, tmp_path / "model.safetensors", {"format": "pt"})
    with pytest.raises(InputError, match="not of a Segment Anything model"):
        sam.outlines(picture(), everything_built(picture()), str(tmp_path), True)


@installed
def test_weights_are_a_folder_or_a_name(weights: Path, tmp_path: Path) -> None:
    folder = (str(weights.resolve()), True)
    assert sam.find_weights(str(weights)) == folder == sam.find_weights(str(weights / "model.safetensors"))
    assert sam.find_weights("facebook/sam-vit-base") == ("facebook/sam-vit-base", False)
    with pytest.raises(InputError, match=r"sampling.sam_weights is empty.*\n.*facebook/sam-vit-base"):
        sam.find_weights(None)
    with pytest.raises(InputError, match="no folder and no name"):
        sam.find_weights(str(tmp_path / "not" / "there"))
    (tmp_path / "config.json").touch()
    with pytest.raises(InputError, match=r"no model\.safetensors"):
        sam.find_weights(str(tmp_path))


def test_without_the_library_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aug3d_core.domes.sam_weights.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"transformers.*\n.*pip install"):
        sam.find_weights("facebook/sam-vit-base")
