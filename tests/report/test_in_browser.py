"""The report in a browser: what a click enlarges, what a slider shows, and what is left of it on paper."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from playwright.sync_api import Page, expect, sync_playwright

from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.files import TEST_VIEWS, prediction_of, truth_of
from aug3d_core.metrics.scene_metrics import scene_metrics
from aug3d_core.photos.files import image_name
from aug3d_core.report.scene_report import write_report
from tests.report.made_up_run import record
from tests.report.test_scene_report import EVALUATION

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed")
_WIDTH, _HEIGHT = 1000, 600


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the report of a run with a panel, and a red prediction of a blue photograph."""
    folder = tmp_path_factory.mktemp("shown")
    rows = {
        "group": [0, 1],
        "photo_id": [7, 12],
        "psnr": [17.2, 24.0],
        "ssim": [0.7, 0.5],
        "mean_colour_psnr": [16, 17],
    }
    pd.DataFrame(rows).to_parquet(folder / TEST_VIEWS)
    for name, colour in ((prediction_of(image_name(7)), (255, 0, 0)), (truth_of(image_name(7)), (0, 0, 255))):
        (folder / name).parent.mkdir(exist_ok=True)
        Image.new("RGB", (88, 56), colour).save(folder / name)
    Image.new("RGB", (110, 70)).save(folder / "panel.png")
    done = record("evaluation", metrics=EVALUATION, pictures={"A panel": "panel.png"})
    made = [(Step(STAGES["evaluation"]), done, folder)]
    write_report(made, scene_metrics("s", "tiny", "abc", 1.0, made), folder / "report.html")
    return folder / "report.html"


@pytest.fixture
def page(report: Path) -> Iterator[Page]:
    """Open the report; it must not run into its own content security policy."""
    expect.set_options(timeout=60_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page, said = browser.new_page(viewport={"width": _WIDTH, "height": _HEIGHT}), []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(report.as_uri())
        yield page
        browser.close()
    assert not said


def test_a_click_shows_a_picture_as_large_as_the_window_and_another_one_at_its_own_size(page: Page) -> None:
    page.get_by_alt_text("A panel").click()
    large = page.locator("dialog > img")
    box = large.bounding_box()
    assert box and box["width"] > 0.95 * _WIDTH and box["height"] > 0.9 * _HEIGHT
    large.click()
    box = large.bounding_box()
    assert box and (box["width"], box["height"]) == (110, 70)
    page.get_by_label("Close").click()
    expect(page.locator("dialog")).to_be_hidden()


def test_a_pair_is_enlarged_with_its_slider(page: Page) -> None:
    expect(page.get_by_label("Enlarge")).to_have_count(2)  # the worst stands in the answer, too
    page.get_by_label("Enlarge").last.click()
    pair = page.locator("dialog .slider")
    box = pair.bounding_box()
    assert box and box["height"] == pytest.approx(0.96 * _HEIGHT, rel=0.02)
    pair.locator("input").fill("25")
    assert pair.evaluate("one => one.style.getPropertyValue('--at')") == "25%"
    page.keyboard.press("Escape")
    expect(page.locator("dialog")).to_be_hidden()
    assert page.locator("#test .slider").evaluate("one => one.style.getPropertyValue('--at')") == ""


@pytest.mark.parametrize("width", [360, 420, 700, _WIDTH])
def test_the_names_of_answers_stay_inside_their_card(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": _HEIGHT})
    card = page.locator("#summary .hero").bounding_box()
    said = [one.bounding_box() for one in page.locator("#summary .hero svg text").all()]
    assert card and len(said) >= 14
    for box in said:
        assert box and card["x"] <= box["x"] and box["x"] + box["width"] <= card["x"] + card["width"]


def test_on_paper_pairs_stand_side_by_side_and_nothing_is_folded_up(page: Page) -> None:
    page.emulate_media(media="print")
    predicted, true = (
        page.locator(f"#test .slider img[alt={name}]").bounding_box() for name in ("predicted", "photograph")
    )
    assert predicted and true and predicted["x"] + predicted["width"] <= true["x"] and predicted["y"] == true["y"]
    assert page.locator("nav").is_hidden() and page.get_by_label("Enlarge").last.is_hidden()
    assert page.get_by_text("Each use is as good as").is_visible()
    pages = len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4")))
    assert 2 <= pages <= 5, "the answer alone on the first"
