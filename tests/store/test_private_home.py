"""Only its owner reads the home folder, and no folder of the user's is closed that holds more than aug3d's things."""

from __future__ import annotations

import stat
from pathlib import Path

from aug3d_core.store.store import Store


def mode(folder: Path) -> int:
    return stat.S_IMODE(folder.stat().st_mode)


def test_a_new_home_is_its_owners(tmp_path: Path) -> None:
    assert mode(Store(tmp_path / "new" / "home").root) == 0o700


def test_a_home_of_an_earlier_version_is_closed(tmp_path: Path) -> None:
    home = Store(tmp_path / "home").root
    (home / "mlflow.db-wal").touch()
    home.chmod(0o755)
    assert mode(Store(home).root) == 0o700


def test_a_folder_with_other_things_stays_open(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "holiday.jpg").touch()
    (tmp_path / "home").chmod(0o755)
    assert mode(Store(tmp_path / "home").root) == 0o755
