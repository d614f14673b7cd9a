import re
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from aug3d_core.charts.report import write_report
from aug3d_core.charts.scene_metrics import scene_metrics
from aug3d_core.errors import InputError
from aug3d_core.stages import STAGES
from aug3d_core.store import layout
from aug3d_core.store.record import Record

EVALUATION = {
    "test_views": 2, "test_psnr_mean": 21.4, "test_psnr_ci_low": 20.9, "test_psnr_ci_high": 22.3,
    "test_ssim_mean": 0.61,
    "group_best": 24.0, "group_low": 17.2, "group_average": 21.3, "cheap_mean_colour": 16.6, "cheap_nearest_copy": 15.0,
    "cheap_ground_homography": 22.7, "cheap_mesh_render": None,
}  # fmt: skip


def record(stage: str, **changes) -> Record:
    values = {
        "stage": stage, "key": "k" * 64, "digest": "d" * 64, "recipe": "r" * 64, "config": {"seed": 3}, "inputs": {},
        "versions": {"bpy": "5.0.1"},
        "files": {}, "metrics": {"vertices": 12345}, "state": "ok", "notes": (), "series": {}, "pictures": {},
        "seconds": 12.5, "peak_mib": 900.0,
    }  # fmt: skip
    return Record(**(values | changes))


def made(folder: Path) -> list:
    """A run of three stages with a picture, a curve, a note and held-out photos."""
    Image.new("RGB", (70, 110), (200, 30, 30)).save(folder / "top.png")
    pd.DataFrame({
        "group": [0, 1], "photo_id": [7, 12], "psnr": [24.0, 17.2], "ssim": [0.7, 0.5], "coarse_psnr": [20.0, 16.0],
        "mean_colour_psnr": [16.0, 17.0], "ground_homography_psnr": [22.5, 22.9],
    }).to_parquet(folder / layout.TEST_VIEWS)  # fmt: skip
    return [
        (STAGES["surface"], record("surface", pictures={"From <above>": "top.png"}, notes=("few points",)), folder),
        (STAGES["training"], record("training", series={"train_psnr": ((0, 12.0), (100, 17.0), (200, 19.5))}), folder),
        (STAGES["evaluation"], record("evaluation", metrics=EVALUATION), folder),
    ]


def report(folder: Path, failure=None) -> str:
    records = made(folder) if failure is None else made(folder)[:1]
    metrics = scene_metrics(
        "scene & co", "tiny", "abc", 300.0, [(r, i == 0) for i, (_, r, _) in enumerate(records)], failure
    )
    metrics["paths"] = {"report": str(folder)}
    write_report(records, metrics, folder / "report.html")
    return (folder / "report.html").read_text(encoding="utf-8")


class Balance(HTMLParser):
    """Complain about elements that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in {"meta", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.parametrize("failure", [None, InputError("photo 7 <is> gone", "bring it back")])
def test_the_page_is_whole_and_needs_no_network(tmp_path, failure):
    page = report(tmp_path, failure)
    parser = Balance()
    parser.feed(page)
    assert parser.open == []
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "http" not in page
    assert str(tmp_path) not in page


def test_it_tells_what_the_run_found(tmp_path):
    page = report(tmp_path)
    assert "scene &amp; co" in page
    assert "<b>1.30 dB below</b> the best cheap answer, ground homography" in page
    assert "few points" in page
    assert "From &lt;above&gt;" in page
    assert page.count("data:image/png;base64,") == 1
    assert '<span class="best">22.90</span>' in page  # photo 12, where the homography is best
    assert '<span class="best">24.00</span>' in page
    assert "no answer" in page
    assert 'class="line"' in page


def test_a_failed_run_says_why_and_what_to_do(tmp_path):
    page = report(tmp_path, InputError("photo 7 <is> gone", "bring it back"))
    assert "photo 7 &lt;is&gt; gone" in page
    assert "bring it back" in page
    assert "refused" in page


def test_the_same_run_gives_the_same_page(tmp_path):
    assert report(tmp_path) == report(tmp_path)


def test_a_run_without_any_stage_still_has_a_page(tmp_path):
    metrics = scene_metrics("empty", "tiny", "abc", 0.1, [], InputError("no photos", "add some"))
    write_report([], metrics, tmp_path / "report.html")
    assert "no photos" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_photos_that_fell_out_are_listed_with_the_reason(tmp_path):
    row = {"photo_id": 3, "name": "<a>.jpg", "reason": "too blurred", "features": 40, "matched_pairs": 1}
    pd.DataFrame([row]).to_parquet(tmp_path / layout.UNPLACED)
    metrics = scene_metrics("s", "tiny", "abc", 1.0, [], None)
    write_report(
        [(STAGES["sfm"], record("sfm"), tmp_path)],
        metrics | {"stages": {"sfm": {"seconds": 1.0, "cached": False, "peak_mib": 1.0}}},
        tmp_path / "report.html",
    )
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "&lt;a&gt;.jpg" in page and "too blurred" in page
