from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.report.sections.needs import needs
from aug3d_core.run.stage import Decision
from tests.report.made_up_run import flown, record, run_of


def row(page: str, what: str) -> str:
    return page.partition(f">{what}<")[2].partition("</tr>")[0]


def test_every_choice_stands_with_its_reason(tmp_path):
    page = needs(flown(tmp_path))
    assert "incremental" in row(page, "mapper") and "few" in row(page, "mapper")
    assert "RADIAL 0.25 px" in row(page, "camera model")
    assert "level" in row(page, "ground model") and "4,000 points" in row(page, "ground model")
    assert "because" in row(page, "photographs in a group (K)")


def chose(field, value, rule="as set"):
    return Decision(field=field, value=value, measured="", rule=rule)


def test_the_mesh_has_a_reason_for_each_size(tmp_path):
    deep, half, asked = "deep <enough>", "half would move", "as asked"
    decisions = (
        chose("surface.octree_depth", 9, deep),
        chose("surface.triangles", 1234, half),
        chose("surface.texels", 5678, asked),
    )
    page = needs(run_of([(Step(STAGES["surface"]), record("surface", decisions=decisions), tmp_path)]))
    assert "1,234" in row(page, "mesh: triangles") and "half would move" in row(page, "mesh: triangles")
    assert "deep &lt;enough&gt;" in row(page, "mesh: octree depth") and "5,678" in row(page, "mesh: texels")


def test_later_folds_repeat_nothing_of_what_they_share(tmp_path):
    grouping = record("grouping", metrics={"folds": 2, "k": 4}, decisions=(chose("grouping.k", 4),))
    steps = [(Step(STAGES["sfm"]), record("sfm", decisions=(chose("sfm.mapper", "global"),)), tmp_path)]
    steps += [(Step(STAGES["grouping"], fold), grouping, tmp_path) for fold in (0, 1)]
    run = run_of(steps)
    assert "mapper" in needs(run) and "mapper" not in needs(run.in_fold(1)) and "(K)" in needs(run.in_fold(1))


def test_nothing_made_needs_nothing():
    assert needs(run_of([])) == ""


def test_what_auto_decided_stands_out_with_what_it_saves_and_may_cost(tmp_path):
    decided = {"step": "depth", "fold": 0, "by": "auto", "field": "depth.max_px", "value": 288, "measured": "views of <96>",
               "rule": "3 times", "saves": "most of it", "costs": "a little"}  # fmt: skip
    page = needs(run_of([], needs=[decided]))
    shown = row(page, "depth.max_px")
    assert "<b>depth.max_px</b>" in page and "288" in shown and "&lt;96&gt;" in shown and "may cost" in page
    assert "most of it" in shown and "a little" in shown
