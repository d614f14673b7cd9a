from pathlib import Path

from aug3d_core.bench.figure import names_of


def test_folders_of_one_name_are_told_apart_by_the_folder_above():
    folders = [Path("/data/ochota/images"), Path("/data/beach/images"), Path("/data/town")]
    assert names_of(folders) == ["ochota_images", "beach_images", "town"]
    assert names_of([Path("/data/ochota/images")]) == ["images"]
