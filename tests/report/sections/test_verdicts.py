import pytest

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.report.sections.verdicts import lights, verdicts
from tests.report.made_up_run import flown, record, run_of

CHEAP = {"mean_colour": 15.0, "nearest_copy": None, "mesh_render": 24.0}


@pytest.mark.parametrize(("share", "light"), [(1.0, "good"), (0.95, "good"), (0.8, "check"), (0.5, "bad")])
def test_the_light_follows_the_bounds_that_are_written_beside_it(tmp_path, share, light):
    sfm = record("sfm", metrics={"registered_share": share, "registered": 1, "photos": 2})
    judged = verdicts(run_of([(Step(STAGES["sfm"]), sfm, tmp_path)]))
    (placed,) = [one for one in judged if one.what == "photographs with a pose"]
    assert placed.light == light
    assert "95 %" in placed.bounds and "75 %" in placed.bounds
    assert f'<span class="light {light}">{light}</span>' in lights(judged)


@pytest.mark.parametrize(
    ("model", "low", "light"), [(25.0, 0.2, "good"), (25.0, -0.2, "check"), (20.0, -5.0, "check"), (14.0, -11.0, "bad")]
)
def test_the_model_is_judged_by_its_paired_lead_over_the_cheap_answers(model, low, light):
    nvs = {"test_psnr_mean": model, "cheap": CHEAP, "over_ci": {key: [low, model - 23] for key in CHEAP}}
    _, judged = verdicts(run_of([], nvs=nvs))
    assert judged.light == light and "mesh render" in judged.what
    assert judged.figure == f"{model - 24:+.2f} dB ({low:+.2f} to {model - 23:+.2f})"


@pytest.mark.parametrize(
    ("psnr", "light"), [(31.0, "good"), (25.0, "good"), (24.9, "check"), (20, "check"), (19.9, "bad")]
)
def test_predictions_are_judged_by_how_far_their_pixels_are_off(psnr, light):
    nvs = {"test_psnr_mean": psnr, "cheap": {"nearest_copy": None}, "over_ci": {}}
    (judged,) = verdicts(run_of([], nvs=nvs))
    assert judged.light == light and "bad below 20 dB (pixels 10 % of full brightness off)" in judged.bounds


def test_the_worst_leak_audit_of_all_folds_counts(tmp_path):
    grouping = (Step(STAGES["grouping"]), record("grouping", metrics={"folds": 2}), tmp_path)
    audits = [
        (Step(STAGES["dataset"], fold), record("dataset", metrics={"leak_audit": found}), tmp_path)
        for fold, found in enumerate(("pass", "doubtful"))
    ]
    (judged,) = [one for one in verdicts(run_of([grouping, *audits])) if one.what == "leak audit"]
    assert judged.light == "check" and judged.figure == "pass, doubtful"


def test_overlap_and_gps_are_judged_from_the_files(tmp_path):
    judged = {one.what: one for one in verdicts(flown(tmp_path))}
    assert judged["GPS error, median"].figure == "5.0 m"
    assert judged["ground seen by 5 or more photographs"].light == "bad"


def test_nothing_made_is_nothing_judged():
    assert verdicts(run_of([])) == () and lights(()) == ""


def test_one_bad_fold_is_enough(tmp_path):
    grouping = (Step(STAGES["grouping"]), record("grouping", metrics={"folds": 2}), tmp_path)
    folds = [
        (Step(STAGES["overlap"], fold), record("overlap", metrics={"bad_members_share": share}), tmp_path)
        for fold, share in enumerate((0.0, 0.6))
    ]
    (judged,) = verdicts(run_of([grouping, *folds]))
    assert judged.light == "bad" and judged.figure == "60.0 %" and "worst of 2 folds" in judged.bounds
