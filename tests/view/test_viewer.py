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
import pandas as pd
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from aug3d_core.dataset.scene import REAL, Scene
from aug3d_core.run.errors import UsageError
from aug3d_core.view.poses import Pose
from aug3d_core.view.viewer import Viewer
from tests.view import finished_scene as toy
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


_HOSTILE = '<iframe srcdoc="<img src=x onerror=parent.document.title=1337>"><b>_DSC{}_.jpg'


def _hostile_names(files: Path, scene: Scene, _mesh: object) -> None:
    ids = np.flatnonzero(scene.source == REAL)
    names = [_HOSTILE.format(one) for one in ids]
    pd.DataFrame({"photo_id": ids, "name": names}).to_parquet(files / "photos.parquet")


def test_the_prediction_follows_the_camera_and_names_are_only_text(
    tmp_path: Path, browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(toy._STAGES, "photos", _hostile_names)
    finished_scene(tmp_path)
    with page_of(tmp_path, browser, own_token=False) as page:
        said = list[str]()
        page.on("console", lambda message: said.append(message.text))
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
        assert page.get_by_text("from <iframe srcdoc=").count() == 1 and "_DSC" in page.content()
        assert page.locator("iframe").count() == 0 and page.title() != "1337"
        assert not [line for line in said if "Content Security Policy" in line]


def test_a_scene_without_a_model_says_so_and_is_shown(tmp_path: Path, browser: Browser) -> None:
    finished_scene(tmp_path, without=("dataset", "training"))
    with page_of(tmp_path, browser) as page:
        page.get_by_text("No predictions").wait_for(timeout=_PATIENCE_MS)
        assert page.get_by_text("scene 'toy' has no dataset").count()
        assert page.get_by_text("36 of 36 photographs have a pose").count()


def test_a_view_that_fails_is_told_and_the_next_one_is_predicted() -> None:
    class Failing:
        def predict(self, *_: object, **__: object) -> None:
            raise MemoryError("the GPU has none left")

    viewer = Viewer.__new__(Viewer)
    viewer._predictor, viewer._seconds = Failing(), []  # type: ignore[assignment]
    viewer._picture, viewer._told = SimpleNamespace(), SimpleNamespace()  # type: ignore[assignment]
    viewer._predict(None, still=True)  # type: ignore[arg-type]
    assert "the GPU has none left" in viewer._told.content and viewer._view is None


@pytest.mark.parametrize(
    ("error", "says"),
    [(MemoryError("<b>none left</b>"), r"MemoryError\: \<b\>none left"), (UsageError("a", "b_c"), r"a\: b\_c")],
)
def test_a_film_that_fails_is_told_on_the_page_and_leaves_no_file(error: Exception, says: str, tmp_path: Path) -> None:
    class Failing:
        scene = SimpleNamespace(scale=1.0)

        def predict(self, *_: object) -> None:
            raise error

    viewer = Viewer.__new__(Viewer)
    viewer._predictor, viewer._folder, viewer._shown = Failing(), tmp_path, SimpleNamespace(name="toy")  # type: ignore[assignment]
    viewer._path, viewer._write = SimpleNamespace(), SimpleNamespace(disabled=False)  # type: ignore[assignment]
    away = np.eye(4)
    away[0, 3] = 1.0
    viewer._keys = [Pose(np.eye(4), 1.0), Pose(away, 1.0)]
    viewer._film()
    assert says in viewer._path.content and not viewer._write.disabled and not list(tmp_path.iterdir())


def test_names_and_errors_are_only_text_in_the_page() -> None:
    viewer = Viewer.__new__(Viewer)
    viewer._told = viewer._photo_told = SimpleNamespace()  # type: ignore[assignment]
    viewer.say(UsageError("<img src=x>", "![a](/etc/passwd)"))
    assert "<img" not in viewer._told.content.replace("\\<", "") and "![" not in viewer._told.content
    viewer._shown = SimpleNamespace(views=SimpleNamespace(photo_id=[7]))  # type: ignore[assignment]
    viewer._photo_of = lambda _: Path("/nowhere/<i>.png")
    viewer._show_photograph(0)
    assert r"\<i\>\.png" in viewer._photo_told.content
