"""What the town's stage keeps on the disk while it works. Its photographs themselves are in tests/engines."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.rendering.job import RenderJob
from aug3d_core.town import stage
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone import studio
from aug3d_core.town.files import TOWN_PHOTOS, TOWN_TRUTH
from aug3d_core.town.generator.terrain import terrain_of
from aug3d_core.town.generator.town import Town, build_town
from aug3d_core.town.stage import assist, run

CONFIG = TownConfig(length_m=70, width_m=70, altitude_m=45, width_px=320, max_photos=5, photos_per_shard=2)
SHARDS = 3


class Renderer:
    """Stand in for the workers: grey pictures. made: the shards; there: what is in the folder of each before it is made."""

    def __init__(self) -> None:
        self.made: list[Path] = []
        self.there: list[set[Path]] = []

    def render(self, job: RenderJob, on_view: Callable[[int], None]) -> None:
        [shard] = job.shards
        self.there.append({*shard.out.parent.iterdir()})
        self.made.append(shard.out)
        size = (shard.last - shard.first, 240, 320)
        np.savez(shard.out, rgb=np.full((*size, 3), 120, np.uint8), alpha=np.full(size, 255, np.uint8))


@cache  # it takes seconds
def _town() -> Town:
    return build_town(CONFIG, terrain_of(CONFIG), np.random.default_rng(0))


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch) -> Renderer:
    stand_in = Renderer()
    monkeypatch.setattr(studio, "render", stand_in.render)
    monkeypatch.setattr(stage, "build_town", lambda *_: _town())
    return stand_in


@pytest.mark.parametrize(("entry", "outputs"), [(run, {"photos.png"}), (assist, set())])
def test_one_shard_at_a_time_is_on_the_disk_of_the_photographs_and_none_is_an_output(
    renderer: Renderer, tmp_path: Path, entry: Callable[..., object], outputs: set[str]
) -> None:
    entry({}, CONFIG, tmp_path, lambda *_: None)
    assert len(renderer.made) == SHARDS and all(tmp_path in shard.parents for shard in renderer.made)
    assert all(there == renderer.there[0] for there in renderer.there)
    assert {path.name for path in tmp_path.iterdir()} == {TOWN_PHOTOS, TOWN_TRUTH, *outputs}


def test_what_a_killed_try_rendered_is_no_output(renderer: Renderer, tmp_path: Path) -> None:
    run({}, CONFIG, tmp_path, lambda *_: None)
    as_it_was, shard = {*tmp_path.rglob("*")}, renderer.made[-1]
    shard.parent.mkdir()
    shard.write_bytes(b"half a shard")
    run({}, CONFIG, tmp_path, lambda *_: None)
    assert {*tmp_path.rglob("*")} == as_it_was and len(renderer.made) == SHARDS
