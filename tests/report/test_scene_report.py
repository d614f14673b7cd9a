import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.dataset.files import LEAK_AUDIT
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.files import CONVENTIONS, TEST_VIEWS
from aug3d_core.judging.summary import CHEAP, interval, summary
from aug3d_core.metrics.flat import flat_metrics
from aug3d_core.metrics.scene_metrics import scene_metrics
from aug3d_core.report.scene_report import write_report
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import TRACKS, UNPLACED
from tests.report.made_up_run import EVIL, flown, record

EVALUATION = {
    "test_views": 2, "test_psnr_mean": 21.4, "test_psnr_ci_low": 20.9, "test_psnr_ci_high": 22.3,
    "test_psnr_worst": 17.2, "test_psnr_best": 24.0, "test_ssim_mean": 0.61,
    "group_best": 24.0, "group_low": 17.2, "group_average": 21.3, "cheap_mean_colour": 16.6, "cheap_nearest_copy": 15.0,
    "cheap_ground_homography": 22.7, "cheap_plane_sweep": 22.1, "cheap_mesh_render": None, "cheap_guided_blend": None,
    **{f"over_{name}_ci_{end}": db for name in CHEAP for end, db in (("low", -2.0), ("high", 0.5))},
}  # fmt: skip


def made(folder: Path) -> list:
    """A run of three stages with a picture, a curve, a note and held-out photos."""
    Image.new("RGB", (70, 110), (200, 30, 30)).save(folder / "top.png")
    pd.DataFrame({
        "group": [0, 1], "photo_id": [7, 12], "psnr": [24.0, 17.2], "ssim": [0.7, 0.5], "coarse_psnr": [20.0, 16.0],
        "mean_colour_psnr": [16.0, 17.0], "ground_homography_psnr": [22.5, 22.9],
    }).to_parquet(folder / TEST_VIEWS)  # fmt: skip
    return [
        (
            Step(STAGES["surface"]),
            record("surface", pictures={"From <above>": "top.png"}, notes=("few points",)),
            folder,
        ),
        (
            Step(STAGES["training"]),
            record("training", series={"train_psnr": ((0, 12.0), (100, 17.0), (200, 19.5))}),
            folder,
        ),
        (Step(STAGES["evaluation"]), record("evaluation", metrics=EVALUATION), folder),
    ]


def report(folder: Path, failure=None) -> str:
    records = made(folder) if failure is None else made(folder)[:1]
    metrics = scene_metrics("scene & co", "tiny", "abc", 300.0, records, {"surface"}, failure)
    metrics["paths"] = {"report": str(folder)}
    write_report(records, metrics, folder / "report.html")
    return (folder / "report.html").read_text(encoding="utf-8")


class Balance(HTMLParser):
    """Complain about elements that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in {"meta", "img", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.parametrize("failure", [None, InputError("photo 7 <is> gone", "bring it back")])
def test_the_page_is_whole_and_needs_no_network(tmp_path, failure):
    page = report(tmp_path, failure)
    parser = Balance()
    parser.feed(page)
    assert parser.open == []
    assert "could not be drawn" not in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert "://" not in page
    assert set(re.findall('href="#([^"]+)"', page)) == set(re.findall('<section id="([^"]+)"', page))
    assert str(tmp_path) not in page


def test_it_tells_what_the_run_found(tmp_path):
    page = report(tmp_path)
    assert "scene &amp; co" in page
    assert "<b>1.30 dB below</b> the best cheap answer, ground homography (95 % interval" in page
    assert "-2.00 to +0.50 dB, paired over photographs: not decided)" in page
    assert "few points" in page
    assert "From &lt;above&gt;" in page
    assert page.count("data:image/png;base64,") == 1
    assert '<span class="best">22.90</span>' in page  # photo 12, where the homography is best
    assert '<span class="best">24.00</span>' in page
    assert "no answer" in page
    assert 'class="line"' in page


def test_groups_are_told_as_in_the_paper_s_first_table(tmp_path):
    page = report(tmp_path)
    row = page.partition("<h3>Test groups</h3>")[2].partition("PixelNeRF</td>")[2].partition("</tr>")[0]
    assert re.findall(r"[\d.]{4,}", row) == ["24.00", "17.20", "20.60", "0.600"]


def test_the_rules_of_scoring_stand_above_the_groups(tmp_path):
    stated = {"answers": "rounded", "psnr": "over all <pixels>", "photographs": "sRGB"}
    (tmp_path / CONVENTIONS).write_text(json.dumps(stated))
    assert "Answers are rounded. PSNR over all &lt;pixels&gt;. Photographs: sRGB." in report(tmp_path)


def folded(folder: Path, tested: int = 2) -> list:
    """A run of two folds, one test view each, of which some are tested."""
    steps = [(Step(STAGES["grouping"]), record("grouping", metrics={"folds": 2}), folder)]
    for fold, psnr in enumerate((24.0, 17.0)[:tested]):
        files = folder / f"fold{fold}"
        files.mkdir()
        row = {"group": 0, "photo_id": fold, "psnr": psnr, "ssim": 0.5, "flip": 0.2, "coarse_psnr": 16.0}
        answers = {f"{name}_{score}": psnr - 2 for name in CHEAP for score in ("psnr", "ssim", "flip")}
        pd.DataFrame([row | answers]).to_parquet(files / TEST_VIEWS)
        figures = summary(pd.DataFrame([row | answers]))
        config = EvaluationConfig().model_dump()
        Image.new("RGB", (9, 9)).save(files / "panel.png")
        pictures = {f"Panel of fold {fold}": "panel.png"}
        done = record("evaluation", metrics=figures, config=config, pictures=pictures)
        steps.append((Step(STAGES["evaluation"], fold), done, files))
    return steps


def test_folds_are_told_apart_and_the_figures_are_over_all(tmp_path):
    made = folded(tmp_path)
    metrics = scene_metrics("small", "tiny", "abc", 1.0, made)
    assert list(metrics["stages"]) == ["grouping", "evaluation", "evaluation_fold1"]
    nvs = metrics["nvs"]
    assert nvs["test_views"] == 2 and nvs["test_psnr_mean"] == 20.5 and nvs["fold_psnr_means"] == [24.0, 17.0]
    assert nvs["groups"] == {"best": 24.0, "low": 17.0, "average": 20.5}
    assert nvs["cheap"] == dict.fromkeys(CHEAP, 18.5)
    assert nvs["over_ci"] == {key: (2.0, 2.0) for key in CHEAP}
    assert nvs["test_psnr_ci"] == pytest.approx(interval(np.array([24.0, 17.0])), abs=1e-3)
    assert flat_metrics(metrics)["nvs.test_psnr_mean"] == 20.5
    write_report(made, metrics, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "2 folds; every figure covers all of them. By fold: 24.00, 17.00 dB." in page
    assert "Single photographs: 17.00 to 24.00 dB." in page
    assert "evaluation fold1" in page
    assert page.index("Panel of fold 0") < page.index("Panel of fold 1")
    parser = Balance()
    parser.feed(page)
    assert parser.open == []


def test_while_a_fold_is_not_tested_there_is_no_figure_over_all(tmp_path):
    metrics = scene_metrics("small", "tiny", "abc", 1.0, folded(tmp_path, 1), failure=InputError("no dome", "fly on"))
    assert "nvs" not in metrics and "evaluation" in metrics["stages"]


def test_the_leak_audit_is_shown_fold_by_fold(tmp_path):
    made = [(Step(STAGES["grouping"]), record("grouping", metrics={"folds": 2}), tmp_path)]
    for fold, figure in enumerate((1.25, 0.875)):
        files = tmp_path / f"fold{fold}"
        files.mkdir()
        check = {"check": "footprints apart", "figure": figure, "bound": "at least 1", "passed": figure >= 1}
        (files / LEAK_AUDIT).write_text(json.dumps({"checks": [check]}))
        made.append((Step(STAGES["dataset"], fold), record("dataset"), files))
    write_report(made, scene_metrics("s", "tiny", "abc", 1.0, made), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Leak audit" in page and "at least 1" in page and ">1.25<" in page
    assert '<b class="degraded">0.875</b>' in page


def test_a_failed_run_says_why_and_what_to_do(tmp_path):
    page = report(tmp_path, InputError("photo 7 <is> gone", "bring it back"))
    assert "photo 7 &lt;is&gt; gone" in page
    assert "bring it back" in page
    assert "refused" in page


def test_the_same_run_gives_the_same_page(tmp_path):
    assert report(tmp_path) == report(tmp_path)


def test_a_run_without_any_stage_still_has_a_page(tmp_path):
    metrics = scene_metrics("empty", "tiny", "abc", 0.1, [], failure=InputError("no photos", "add some"))
    write_report([], metrics, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "no photos" in page
    assert re.findall("<h2>([^<]+)", page) == ["Summary", "Origin"]


def test_photos_that_fell_out_are_listed_with_the_reason(tmp_path):
    row = {"photo_id": 3, "name": "<a>.jpg", "reason": "too blurred", "features": 40, "matched_pairs": 1}
    pd.DataFrame([row]).to_parquet(tmp_path / UNPLACED)
    metrics = scene_metrics("s", "tiny", "abc", 1.0, [])
    write_report(
        [(Step(STAGES["sfm"]), record("sfm"), tmp_path)],
        metrics | {"stages": {"sfm": {"seconds": 1.0, "cached": False, "peak_mib": 1.0}}},
        tmp_path / "report.html",
    )
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "&lt;a&gt;.jpg" in page and "too blurred" in page


def test_a_flight_is_reported_whole_whatever_its_files_are_called(tmp_path):
    run = flown(tmp_path)
    write_report(run.made, run.metrics, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    parser = Balance()
    parser.feed(page)
    assert parser.open == [] and "could not be drawn" not in page
    assert EVIL not in page and page.count("<script>") == 1
    titles = re.findall("<h2>([^<]+)", page)
    assert titles == ["Answer", "Summary", "Map", "Cameras", "Overlap", "Groups", "Decisions", "Cost", "Origin"]


def test_no_other_script_may_run_and_nothing_is_loaded(tmp_path):
    page = report(tmp_path)
    script = re.findall("<script>(.*?)</script>", page, re.DOTALL)[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'" in page
    assert f"script-src 'sha256-{digest}'" in page


def test_a_damaged_file_costs_its_section_alone(tmp_path):
    run = flown(tmp_path)
    (tmp_path / "sfm" / TRACKS).write_bytes(b"torn")
    write_report(run.made, run.metrics, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "could not be drawn" in page and "colours show 2 of 3 groups" in page
    assert re.findall("<h2>([^<]+)", page)[-2:] == ["Cost", "Origin"]
