import re

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.report.sections.headline import headline, notes
from tests.report.made_up_run import record, run_of


def test_what_degrades_a_run_is_said_first_and_never_hidden(tmp_path):
    many = tuple(f"remark <{i}>" for i in range(9))
    made = [
        (Step(STAGES["sfm"]), record("sfm", notes=many), tmp_path),
        (Step(STAGES["depth"]), record("depth", notes=("thin",), state="degraded"), tmp_path),
    ]
    page = notes(run_of(made))
    assert page.index("thin") < page.index("<details>") < page.index("remark &lt;0&gt;")
    assert "9 more notes" in page
    assert "<details>" not in notes(run_of([made[1]]))


def test_state_and_cost_stand_beside_the_name(tmp_path):
    run = run_of([(Step(STAGES["sfm"]), record("sfm", cpu_seconds=90.0), tmp_path)], scene="a & b")
    page = re.sub("<.*?>", "|", headline(run))
    assert all(f"|{text}|" in page for text in ("a &amp; b", "ok", "90.0 s", "900 MiB", "tiny"))
    unknown = run_of([(Step(STAGES["sfm"]), record("sfm"), tmp_path)])
    assert "processors <b>-</b>" in headline(unknown)
