"""The page in a real browser: the camera moves, and the prediction changes; a scene without a model is shown all the same."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from tests.view.finished_scene import finished_scene

CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed"),
]
_SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_PATIENCE_MS = 120_000


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=_SOFTWARE)


@contextmanager
def page_of(home: Path, browser: Browser, own_token: bool = True) -> Iterator[Page]:
    """Run `aug3d view` on the toy, and open its page; without the token at the bare address."""
    words = [str(Path(sys.executable).parent / "aug3d"), "view", "toy", "--port", "0", "--json", "--home", str(home)]
    root = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, text=True, cwd=home, env=os.environ | {"PYTHONPATH": root}
    )
    try:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())["open"]
        page = browser.new_page(viewport={"width": 900, "height": 600})
        page.goto(told if own_token else told.partition("?")[0])
        yield page
        page.close()
    finally:
        process.terminate()
        more, _ = process.communicate(timeout=30)
    assert (process.returncode, more) == (0, "")


def picture(page: Page) -> np.ndarray:
    """Return the prediction as the panel shows it."""
    return np.asarray(Image.open(io.BytesIO(page.locator("img:visible").first.screenshot())).convert("RGB"), int)


def test_the_prediction_follows_the_camera(tmp_path: Path, browser: Browser) -> None:
    finished_scene(tmp_path)
    with page_of(tmp_path, browser, own_token=False) as page:
        page.get_by_label("Password or token").fill((tmp_path / "services/token").read_text())
        page.get_by_role("button", name="Sign in").click()
        page.get_by_text("views a second").wait_for(timeout=_PATIENCE_MS)
        time.sleep(1.0)
        before = picture(page)
        assert np.abs(picture(page) - before).mean() < 1
        page.mouse.move(200, 300)
        page.mouse.down()
        page.mouse.move(330, 330, steps=5)
        page.mouse.up()
        for _ in range(100):
            if np.abs(picture(page) - before).mean() > 5:
                break
            time.sleep(0.1)
        else:
            raise AssertionError("the prediction stayed as it was")
        for name in ("mesh", "points", "cameras", "test views", "virtual domes"):
            assert page.get_by_label(name, exact=True).count(), name


def test_a_scene_without_a_model_says_so_and_is_shown(tmp_path: Path, browser: Browser) -> None:
    finished_scene(tmp_path, without=("dataset", "training"))
    with page_of(tmp_path, browser) as page:
        page.get_by_text("No predictions").wait_for(timeout=_PATIENCE_MS)
        assert page.get_by_text("scene 'toy' has no dataset").count()
        assert page.get_by_text("36 of 36 photographs have a pose").count()


def test_a_view_that_fails_is_told_and_the_next_one_is_predicted() -> None:
    from aug3d_core.view.viewer import Viewer

    class Failing:
        def predict(self, *_: object, **__: object) -> None:
            raise MemoryError("the GPU has none left")

    viewer = Viewer.__new__(Viewer)
    viewer._predictor, viewer._seconds = Failing(), []  # type: ignore[assignment]
    viewer._picture, viewer._told = SimpleNamespace(), SimpleNamespace()  # type: ignore[assignment]
    viewer._predict(None, still=True)  # type: ignore[arg-type]
    assert "MemoryError: the GPU has none left" in viewer._told.content and viewer._view is None
