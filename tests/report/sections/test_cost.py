import re

import pytest

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.cost import cost
from tests.report.made_up_run import record, run_of


def spent(folder) -> ReportedRun:
    sizes = ("sfm", 30.0, 40.0, 500.0), ("depth", 60.0, None, 2000.0), ("training", 210.0, 400.0, 1000.0)
    return run_of(
        [
            (Step(STAGES[name]), record(name, seconds=seconds, cpu_seconds=cpu, peak_mib=mib), folder)
            for name, seconds, cpu, mib in sizes
        ]
    )


def test_bars_are_as_long_as_time_and_memory_and_say_their_share(tmp_path):
    page = cost(spent(tmp_path))
    time, memory = (
        [float(width) for width in re.findall(f'<i class="{kind}" style="width:([\\d.]+)%', page)]
        for kind in ("time", "memory")
    )
    assert [width / time[2] for width in time] == pytest.approx([1 / 7, 2 / 7, 1], abs=0.01)
    assert [width / memory[1] for width in memory] == pytest.approx([0.25, 1, 0.5], abs=0.01)
    assert re.findall(r"· (\d+ %)", page) == ["10 %", "20 %", "70 %"]
    assert "5 min 00 s" in page and "processor time <b>7 min 20 s</b>" in page


def test_what_is_new_since_the_version_before_is_told_as_text(tmp_path):
    run = spent(tmp_path)
    run.metrics["stages"]["sfm"]["why"] = ["1 new: <i>.jpg", "other matching"]
    run.metrics["stages"]["depth"]["why"] = []
    page = cost(run)
    last = [row[-1] for row in (re.findall("<td[^>]*>(.*?)</td>", row) for row in page.split("<tr>")) if row]
    assert last == ["1 new: &lt;i&gt;.jpg; other matching", "unchanged", "-"]


def test_nothing_made_cost_nothing():
    assert cost(run_of([])) == ""
