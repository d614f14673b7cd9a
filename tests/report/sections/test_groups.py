import numpy as np
import pandas as pd

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.overlap.files import OVERLAP_MEMBERS, OVERLAP_TABLE
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.groups import groups
from tests.report.made_up_run import EVIL, flown, record


def measured(root) -> ReportedRun:
    """The made-up run with what the overlap stage and the test found."""
    run, folder = flown(root), root / "overlap"
    folder.mkdir()
    ways = [("scene", 3, 0.0), ("test", 3, 0.0), ("sequence", 10, 0.125), ("sequence", 20, 0.5), ("ray", 10, 0.0001)]
    table = pd.DataFrame(ways, columns=["method", "k", "bad_members_share"]).assign(overlap_mean=0.4)
    table.to_parquet(folder / OVERLAP_TABLE)
    members = [
        ("scene", 0, 100, 20, 0.5),
        ("scene", 0, 100, 10, 0.25),
        ("test", 0, 110, 30, np.nan),
        ("ray", 0, 100, 1, 1),
    ]
    found = pd.DataFrame(members, columns=["method", "group", "centre_photo_id", "shared_points", "overlap"])
    found.to_parquet(folder / OVERLAP_MEMBERS)
    pd.DataFrame({"photo_id": [110], "psnr": [21.25]}).to_parquet(folder / TEST_VIEWS)
    overlap = record("overlap", metrics={"bad_members_share": 0.03})
    evaluation = (Step(STAGES["evaluation"]), record("evaluation"), folder)
    return ReportedRun([*run.made, (Step(STAGES["overlap"]), overlap, folder), evaluation], run.metrics)


def test_a_group_is_told_by_what_its_members_share_with_the_centre(tmp_path):
    page = groups(measured(tmp_path))
    row = page.partition("&lt;script&gt;alert(1)&lt;/script&gt;.jpg")[2].partition("</tr>")[0]
    assert all(f">{cell}<" in row for cell in ("3", "15", "10", "38 %", "25 %"))
    assert EVIL not in page
    test = page.partition(">test<")[2].partition("</tr>")[0]
    assert "110 p10.jpg" in test and ">21.25<" in test and ">-<" in test  # nothing of it could be judged


def test_the_method_of_the_run_stands_out(tmp_path):
    run = measured(tmp_path)
    page = groups(ReportedRun([(s, r.model_copy(update={"metrics": {"method": "ray"}}) if s.name == "grouping" else r, f)
                               for s, r, f in run.made], run.metrics))  # fmt: skip
    assert "<b>ray</b>" in page and "<b>sequence</b>" not in page


def test_ways_of_grouping_stand_side_by_side(tmp_path):
    page = groups(measured(tmp_path))
    sequence = page.partition(">sequence<")[2].partition("</tr>")[0]
    assert ">12.5 %<" in sequence and ">50.0 %<" in sequence
    ray = page.partition(">ray<")[2].partition("</tr>")[0]
    assert "under 0.1 %" in ray and ">-<" in ray
    assert "3.0 % of the members see less than 10 %" in page
