"""A scratch folder is empty at first, whatever a killed try left of it, and gone at the end, whatever that is."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.run.scratch import scratch_folder


@pytest.mark.parametrize("ends", [None, KeyboardInterrupt])
def test_what_a_killed_try_left_is_gone_and_so_is_the_folder_at_the_end(
    tmp_path: Path, ends: type[BaseException] | None
) -> None:
    (tmp_path / "scratch" / "deep").mkdir(parents=True)
    (tmp_path / "scratch" / "deep" / "left").write_text("x")
    try:
        with scratch_folder(tmp_path / "scratch") as folder:
            assert folder == tmp_path / "scratch" and not [*folder.iterdir()]
            (folder / "made").write_text("x")
            if ends:
                raise ends
    except KeyboardInterrupt:
        pass
    assert not [*tmp_path.iterdir()]
