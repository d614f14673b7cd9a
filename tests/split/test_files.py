"""Roles are by view, in whatever order they were written."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from aug3d_core.split.files import SPLIT_TABLE, read_roles


def test_a_view_without_a_role_has_none(tmp_path: Path) -> None:
    pd.DataFrame({"view": [3, 0], "role": ["target", "train"]}).to_parquet(tmp_path / SPLIT_TABLE)
    assert read_roles(tmp_path, 5).tolist() == ["train", "", "", "target", ""]
