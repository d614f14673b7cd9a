"""How many views a dome has follows from the groups."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.read import views_per_dome
from aug3d_core.groups.files import GROUPS
from aug3d_core.run.errors import InputError


@pytest.fixture
def inputs(tmp_path: Path) -> dict[str, Path]:
    np.savez(tmp_path / GROUPS, members=np.zeros((3, 8), np.int32))
    return {"grouping": tmp_path}


@pytest.mark.parametrize(("wanted", "views"), [(None, 8), (8, 8), (12, 12)])
def test_a_dome_has_as_many_views_as_a_group_or_more(inputs: dict[str, Path], wanted: int | None, views: int) -> None:
    assert views_per_dome(inputs, SamplingConfig(views_per_dome=wanted)) == views


def test_fewer_views_than_a_group_has_are_refused(inputs: dict[str, Path]) -> None:
    with pytest.raises(InputError, match=r"views_per_dome=4 is less than the 8 members"):
        views_per_dome(inputs, SamplingConfig(views_per_dome=4))
