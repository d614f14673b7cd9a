"""The answer follows from the checks: what it says for a figure is what the rule says."""

import re

import numpy as np
import pandas as pd
import pytest

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.report.sections.answer import answer, thin_words, worst
from aug3d_core.report.sections.verdicts import MAP, VIEWS, Verdict
from tests.report.made_up_run import EVIL, flown, record, run_of
from tests.report.test_scene_report import EVALUATION

CHEAP = {"nearest_copy": 15.0, "mesh_render": 24.0}


def plain(html: str) -> str:
    return re.sub("<[^>]+>", " ", html)


def placed(share: float, **more) -> dict:
    return {
        "registered_share": share,
        "registered": round(40 * share),
        "photos": 40,
        "gps_residual_m_median": 1.0,
        **more,
    }


def of(folder, metrics: dict, nvs: dict | None = None, failure=None) -> str:
    changes = ({"nvs": nvs} if nvs else {}) | ({"failure": failure} if failure else {})
    return answer(run_of([(Step(STAGES["sfm"]), record("sfm", metrics=metrics), folder)], **changes))


@pytest.mark.parametrize(
    ("share", "said", "word"),
    [(1.0, "Good enough for", "yes"), (0.8, "With care for", "with care"), (0.5, "Not good enough for", "no")],
)
def test_a_use_is_as_good_as_its_worst_check(tmp_path, share, said, word):
    page = of(tmp_path, placed(share, reprojection_px=0.4))
    assert f"{said} {MAP}." in page and f">{word}</span>" in page
    assert ("held back by photographs with a pose: " in page) == (share < 0.95)
    assert ("photographs have no pose" in page) == ("neighbours overlap by 75 %" in page) == (share < 1)


def test_where_all_is_good_nothing_has_to_be_done(tmp_path):
    page = of(tmp_path, placed(1.0))
    assert "Nowhere that was measured." in page
    assert "Nothing has to be done. <code>aug3d predict s</code> makes views" in page


def test_what_is_bad_is_done_first(tmp_path):
    page = plain(of(tmp_path, placed(0.8, reprojection_px=3.0)))
    assert page.index("fixed zoom and focus") < page.index("neighbours overlap by 75 %")


@pytest.mark.parametrize(
    ("ends", "said", "light"),
    [
        ((0.2, 2.0), "The model</b>", "good"),
        ((-0.2, 2.0), "The model or mesh render: neither is surely better</b>", "check"),
        ((-3.0, -0.2), "Mesh render, not the model</b>", "bad"),
        (None, "The model or mesh render</b>", "check"),
    ],
)
def test_which_pictures_to_use_follows_from_the_interval(tmp_path, ends, said, light):
    nvs = {"test_psnr_mean": 25.5, "cheap": CHEAP, "over_ci": dict.fromkeys(CHEAP, ends)}
    page = of(tmp_path, placed(1.0), nvs)
    row = page.partition("The model")[0].rpartition("<li>")[2] if light != "bad" else page.partition("Mesh render")[0]
    assert said in page and f'light {light}">' in row.rpartition("<span")[2]
    assert "+1.50 dB over the best answer without learning, mesh render" in page
    assert f"Good enough for {MAP} and for {VIEWS}." in page
    done = plain(page).partition("What to do")[2]
    assert ("Nothing is decided" in done, "Use the simpler answer" in done) == (light == "check", light == "bad")


@pytest.mark.parametrize("ends", [(-0.9, 0.1), (-0.9, -0.1), None])
@pytest.mark.parametrize("best", ["nearest_copy", "mesh_render"])  # made from the same inputs, and from more
def test_what_to_do_never_contradicts_which_pictures_to_use(tmp_path, ends, best):
    cheap = {"nearest_copy": 15.0, "mesh_render": 15.0} | {best: 24.0}
    nvs = {"test_psnr_mean": 23.6, "cheap": cheap, "over_ci": dict.fromkeys(cheap, ends)}
    page = plain(of(tmp_path, placed(1.0), nvs))
    undecided = ends is None or ends[1] > 0
    assert ("neither is surely better" in page or "decides nothing" in page) == undecided
    assert ("Nothing is decided" in page) == undecided == ("Use the simpler answer" not in page)


def test_the_worst_photograph_is_named(tmp_path):
    rows = {"group": [0, 1], "photo_id": [7, 12], "psnr": [24.0, 20.0], "ssim": [0.7, 0.5]}
    pd.DataFrame(rows).to_parquet(tmp_path / TEST_VIEWS)
    made = [(Step(STAGES["evaluation"]), record("evaluation", metrics=EVALUATION), tmp_path)]
    page = plain(answer(run_of(made)))
    said = "Of the 2 held-out photographs, number 12 is predicted worst: 20.0 dB, pixels 10 % of full brightness off."
    assert said in page


def test_a_photograph_goes_by_its_name_and_one_alone_is_no_worst(tmp_path):
    pd.DataFrame({"photo_id": [7], "name": ["<b>7.jpg"]}).to_parquet(tmp_path / PHOTO_TABLE)
    pd.DataFrame({"group": [0], "photo_id": [7], "psnr": [20.0], "ssim": [0.5]}).to_parquet(tmp_path / TEST_VIEWS)
    photos = (Step(STAGES["photos"]), record("photos"), tmp_path)
    page = answer(run_of([photos, (Step(STAGES["evaluation"]), record("evaluation", metrics=EVALUATION), tmp_path)]))
    assert "The one held-out photograph, &lt;b&gt;7.jpg (number 7), is predicted: 20.0 dB" in page


def test_a_run_that_stopped_says_what_to_do_first(tmp_path):
    page = of(tmp_path, placed(0.8), failure={"problem": "no", "remedy": "fly <again>"})
    assert "The run stopped before its end. With care for" in page
    assert plain(page).partition("What to do")[2].split() and "<ol><li>fly &lt;again&gt;</li>" in page


@pytest.mark.parametrize("preset", ["tiny", "auto"])
def test_a_run_is_not_told_to_use_the_preset_that_it_used(tmp_path, preset):
    overlap = (Step(STAGES["overlap"]), record("overlap", metrics={"bad_members_share": 0.3}), tmp_path)
    page = answer(run_of([overlap], preset=preset, nvs={"test_psnr_mean": 18.0, "cheap": {}}))
    assert "<code>--set grouping.k=N</code>" in page and "<code>aug3d advise s DIR</code> says from where" in page
    assert page.count("<code>--preset auto</code>") == (0 if preset == "auto" else 2)


def test_nothing_measured_has_no_answer():
    assert answer(run_of([])) == ""


def test_a_flight_is_answered_from_its_files(tmp_path):
    page = answer(flown(tmp_path))
    assert "1 of 13 photographs has no pose." in page and EVIL not in page
    thin = "of the mapped ground is in fewer than 5 photographs, most of it beyond the edge of the flight, above all in the"
    assert thin in page and "advise s DIR</code> says what to photograph next within the flight" in page


def ground(rows: slice, columns: slice) -> np.ndarray:
    """Return a map of 7 x 11 pieces of which some are true."""
    some = np.zeros((7, 11), bool)
    some[rows, columns] = True
    return some


ALL = ground(slice(None), slice(None))


@pytest.mark.parametrize(
    ("rows", "columns", "place"),
    [
        (slice(0, 3), slice(7, 11), "in the north-east"),
        (slice(5, 7), slice(4, 7), "in the south"),
        (slice(3, 5), slice(4, 7), "in the middle"),
    ],
)
def test_thin_ground_has_a_place(rows, columns, place):
    thin = ground(rows, columns)
    said = thin_words(thin, ALL, ALL, compass=True)
    assert said.startswith(f"{thin.mean() * 100:.0f} % of the mapped ground")
    assert said.endswith(f"most of it within the flight, above all {place}.")


def test_thin_ground_beyond_the_flight_is_told_from_that_within():
    inside = ground(slice(2, 5), slice(2, 9))
    middle, rim = ground(slice(3, 5), slice(4, 8)), ground(slice(0, 2), slice(0, 3)) | ground(slice(5, 7), slice(9, 11))
    said = thin_words(middle | rim, ALL, inside, compass=True)
    assert said.endswith(
        "most of it beyond the edge of the flight, above all in the north-west: fly further out there if you need it."
    )
    assert "within the flight, above all in the middle." in thin_words(middle, ALL, inside, compass=True)


def test_without_north_a_place_is_on_the_map_and_unknown_ground_does_not_count():
    known = ground(slice(0, 3), slice(0, 4))
    assert thin_words(known, known, ALL, compass=False) == (
        "100 % of the mapped ground is in fewer than 5 photographs, most of it within the flight, above all at the upper left"
        " of the map."
    )


def test_the_worst_light_counts():
    some = [Verdict("", light, "", "", MAP, "") for light in ("good", "check")]
    assert worst(some) == "check" and worst(some[:1]) == "good"
