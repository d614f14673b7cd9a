"""A day with the pages, in a real browser: a schedule fires, a form is filled in, runs are compared, a report is opened."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import psutil
import pytest
import yaml
from playwright.sync_api import Browser, Page, expect, sync_playwright
from playwright.sync_api import TimeoutError as NoAnswer

from aug3d_core.bench.small_town import SETTINGS
from aug3d_core.store import layout
from tests.attack.town_process import begun, hand_over
from tests.tests_support import hear_signals, words_of

CHROMIUM = shutil.which("chromium")
LEFT = ("mesh_truth", "sampling", "rendering", "dataset", "training", "evaluation")  # to be made in this home
SHOTS = Path("test-output") / "daily_use"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed"),
]
_QUIET = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")


@pytest.fixture(scope="module")
def home(first: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a home that knows no scene: its schedule makes the small town, of which all up to the surface is there."""
    folder = tmp_path_factory.mktemp("daily")
    hand_over(first, folder, but=LEFT)
    return folder


@pytest.fixture(scope="module")
def pages(own_environment: None, home: Path) -> Iterator[dict[str, str]]:
    """Put the small town into the registry, to be made every minute, and start `aug3d up`."""
    write_entry(home, schedule={"every": "1m"})
    ports = free_port(), free_port()
    words = ["--home", str(home), "--prefect-port", str(ports[0]), "--mlflow-port", str(ports[1])]
    with (home / "up.log").open("w") as log:
        up = subprocess.Popen(
            [str(Path(sys.executable).parent / "aug3d"), "up", *words],
            stdout=log,
            stderr=log,
            preexec_fn=hear_signals,
        )
        wait(lambda: "ready after" in (home / "up.log").read_text() or up.poll() is not None, 180, "aug3d up is ready")
        assert up.poll() is None, (home / "up.log").read_text()
        addresses = {"prefect": f"http://127.0.0.1:{ports[0]}", "mlflow": f"http://127.0.0.1:{ports[1]}"}
        yield {**addresses, "pid": str(up.pid), "token": (home / "services" / "token").read_text()}
        family = psutil.Process(up.pid).children(recursive=True)
        up.send_signal(signal.SIGINT)
        assert up.wait(60) in (0, 130)
        _, left = psutil.wait_procs(family, timeout=20)
        assert not left, "Ctrl-C ends everything that was started"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    SHOTS.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=_QUIET)


@pytest.fixture
def page(browser: Browser, pages: dict[str, str]) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1366, "height": 900})
    page.set_default_timeout(60_000)
    expect.set_options(timeout=60_000)  # the line above does not cover it, and 5 s are too few on a busy machine
    page.goto(f"{pages['prefect']}/?token={pages['token']}")  # signs in to both
    yield page
    page.close()


def test_a_schedule_fires_publishes_and_then_makes_nothing(pages: dict[str, str], home: Path) -> None:
    wait(lambda: any(begun(home, stage) for stage in LEFT), 180, "a schedule fires")
    write_entry(home)  # no other run is due before this one ends
    wait(lambda: ended(pages, auto=True), 600, "the run of the schedule ends")
    [once] = ended(pages, auto=True)
    assert once["state"]["name"] == "Published", once["state"]["message"]
    asked = ask(pages, f"deployments/{deployment_of(pages, 'town')['id']}/create_flow_run", {})
    wait(lambda: by_hand(pages), 120, "a run that is asked for ends")
    [twice] = by_hand(pages)
    assert (twice["id"], twice["state"]["name"]) == (asked["id"], "Unchanged"), twice["state"]["message"]
    assert twice["total_run_time"] < 30
    assert len(list((home / "scenes" / "town").glob("*/metrics.json"))) == 1


def test_a_field_is_changed_in_the_form_and_the_run_outlives_its_worker(
    pages: dict[str, str], page: Page, home: Path
) -> None:
    before = len(by_hand(pages))
    page.goto(f"{pages['prefect']}/deployments")
    page.get_by_role("link", name="town", exact=True).first.click()
    page.get_by_role("button", name="Run", exact=True).first.click()
    page.get_by_text("Custom run", exact=True).click()
    steps = page.locator("//label[.//span[text()='steps (Optional)']]/following::input[1]")
    expect(steps).to_have_value("30")
    steps.fill("40")
    page.screenshot(path=SHOTS / "form.png", full_page=True)
    submit(page)
    page.goto("about:blank")  # a page that is open asks and draws all the while

    wait(lambda: at_work(home, "training"), 120, "training begins")
    kill_worker(int(pages["pid"]))
    wait(lambda: len(by_hand(pages)) > before, 240, "the run completes")
    run = by_hand(pages)[-1]
    assert run["state"]["name"] == "Tried", run["state"]["message"]
    assert run["run_count"] == 2, "the next worker went on with it"
    page.goto(f"{pages['prefect']}/runs/flow-run/{run['id']}")
    expect(page.get_by_text("Tried").first).to_be_visible()
    expect(page.get_by_text("evaluation", exact=True).first).to_be_visible()  # the page reads its logs late
    assert "town-what-changed" in {left["key"] for left in artifacts_of(pages, run)}
    open_artifact(page, "town-what-changed")
    expect(page.get_by_text("steps 30 -> 40")).to_be_visible()
    page.screenshot(path=SHOTS / "what_changed.png")


def test_cancelling_ends_the_process_that_trains(pages: dict[str, str], home: Path) -> None:
    deployment = deployment_of(pages, "town")
    settings = deployment["parameters"]["settings"]
    settings["training"]["steps"] = 100_000
    run = ask(
        pages,
        f"deployments/{deployment['id']}/create_flow_run",
        {"parameters": {"scene": "town", "settings": settings}},
    )
    wait(lambda: at_work(home, "training"), 120, "training begins")
    ask(pages, f"flow_runs/{run['id']}/set_state", {"state": {"type": "CANCELLING", "name": "Cancelling"}})
    wait(lambda: run["id"] in [done["id"] for done in by_hand(pages)], 60, "the run is cancelled")
    assert next(done for done in by_hand(pages) if done["id"] == run["id"])["state"]["name"] == "Cancelled"
    wait(lambda: not at_work(home, "training"), 60, "the process that trains has ended")


def test_nonsense_through_the_api_is_refused(pages: dict[str, str]) -> None:
    deployment = deployment_of(pages, "town")
    settings = deployment["parameters"]["settings"]
    settings["training"]["steps"] = -5
    with pytest.raises(OSError, match="HTTP Error 4"):
        ask(pages, f"deployments/{deployment['id']}/create_flow_run", {"parameters": {"settings": settings}})


def test_two_runs_are_compared_in_mlflow(pages: dict[str, str], page: Page) -> None:
    address = pages["mlflow"]
    experiment = ask_mlflow(pages, "experiments/get-by-name?experiment_name=town")["experiment"]["experiment_id"]
    query = {"experiment_ids": [experiment], "filter": "attributes.status = 'FINISHED'"}
    runs = ask_mlflow(pages, "runs/search", query)["runs"]
    parents = [r["info"] for r in runs if all(t["key"] != "mlflow.parentRunId" for t in r["data"]["tags"])]
    assert len(parents) == 2
    chosen = json.dumps([info["run_id"] for info in parents])
    page.goto(f'{address}/#/compare-runs?runs={chosen}&experiments=["{experiment}"]')
    expect(page.get_by_text("Comparing 2 Runs").first).to_be_visible()
    expect(page.get_by_text("training.steps").first).to_be_visible()
    page.wait_for_timeout(2000)  # the chart is drawn after the words
    page.screenshot(path=SHOTS / "mlflow_compare.png", full_page=True)


def test_a_study_is_started_and_its_chart_is_in_the_artifacts(pages: dict[str, str], page: Page, home: Path) -> None:
    deployment = deployment_of(pages, "tradeoff")
    page.goto(f"{pages['prefect']}/deployments/deployment/{deployment['id']}")
    page.get_by_role("button", name="Run", exact=True).first.click()
    page.get_by_text("Custom run", exact=True).click()
    expect(page.get_by_text("only (Optional)", exact=True)).to_be_visible()
    page.screenshot(path=SHOTS / "study_form.png", full_page=True)
    page.goto("about:blank")
    given = {"scenes": ["town"], "only": ["features"], "quick": True}
    run = ask(pages, f"deployments/{deployment['id']}/create_flow_run", {"parameters": given})
    wait(lambda: run["id"] in [done["id"] for done in by_hand(pages)], 240, "the study ends")
    told = next(done for done in by_hand(pages) if done["id"] == run["id"])["state"]
    assert told["type"] == "COMPLETED", told["message"]
    [folder] = (home / "studies" / "town").glob("tradeoff-*")
    assert str(folder) in told["message"] and (folder / layout.STUDY_PAGE).is_file()
    [chart] = [left for left in artifacts_of(pages, run) if left["key"] == "study"]
    page.goto(f"{pages['prefect']}/artifacts/artifact/{chart['id']}")
    expect(page.get_by_text("What does accuracy cost?").first).to_be_visible()
    page.screenshot(path=SHOTS / "study.png")


@pytest.mark.parametrize(("width", "height"), [(1366, 768), (390, 844)])
def test_the_report_opens_from_the_disk(
    pages: dict[str, str], browser: Browser, home: Path, width: int, height: int
) -> None:
    report = max((home / "scenes" / "town").glob("*/report.html"))
    page = browser.new_page(viewport={"width": width, "height": height})
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    expect(page.get_by_role("heading", name="town").first).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= width, "nothing sticks out sideways"
    page.screenshot(path=SHOTS / f"report_{width}.png", full_page=True)
    assert [url for url in asked if re.match("https?:", url)] == [], "it needs no network"
    page.close()


def write_entry(home: Path, **more: Any) -> None:
    """Write the small town into the registry."""
    (home / "scenes").mkdir(exist_ok=True)
    # A model of 30 steps may be a dB worse after 40: what is tried here is the road, not the model
    entry = {"photos": None, "preset": "tiny", "settings": SETTINGS, "publish": {"most_psnr_drop_db": 3.0}, **more}
    (home / "scenes" / "town.yaml").write_text(yaml.safe_dump(entry))


def deployment_of(pages: dict[str, str], name: str) -> dict[str, Any]:
    return next(d for d in ask(pages, "deployments/filter", {}) if d["name"] == name)


def submit(page: Page) -> None:
    """Press Submit as a person does: again, if the page did not take it (the form moved, or the database was busy)."""
    for _ in range(3):
        with suppress(NoAnswer):
            with page.expect_response(re.compile("/create_flow_run$"), timeout=20_000) as answer:
                page.get_by_role("button", name="Submit").click()
            if answer.value.ok:
                return
    page.screenshot(path=SHOTS / "not_submitted.png")
    raise AssertionError("the form is not submitted: see not_submitted.png")


def open_artifact(page: Page, key: str) -> None:
    """Open an artifact of the run that is shown as a person does.

    Fifty are listed, in no order, the rest by scrolling. An ended run's list is asked for once, and stays empty if the
    database was busy then, until the page is loaded again.
    """
    for _ in range(3):
        page.get_by_text("Artifacts", exact=True).last.click()
        page.mouse.move(683, 800)
        for _ in range(40):
            if page.get_by_text(key).count():
                return page.get_by_text(key).first.click()
            page.mouse.wheel(0, 1500)
            page.wait_for_timeout(500)
        page.screenshot(path=SHOTS / "no_artifact.png")
        page.reload()
    raise AssertionError(f"the run's page does not list {key}: see no_artifact.png")


def at_work(home: Path, stage: str) -> list[int]:
    """Return the processes that make an object of a stage: they write its log."""
    folder = str(home / "work" / stage)
    found = psutil.process_iter(["open_files"])
    return [p.pid for p in found if any(folder in file.path for file in p.info["open_files"] or [])]


def kill_worker(up: int) -> None:
    for process in psutil.Process(up).children():
        if "flows.worker" in words_of(process):
            os.kill(process.pid, signal.SIGKILL)
            return
    raise AssertionError("there is a worker")


def by_hand(pages: dict[str, str]) -> list[dict[str, Any]]:
    return ended(pages, auto=False)


def ended(pages: dict[str, str], *, auto: bool) -> list[dict[str, Any]]:
    """Return the ended runs of deployments, oldest first, that a schedule or that a person started."""
    runs = ask(pages, "flow_runs/filter", {"sort": "EXPECTED_START_TIME_ASC"})
    final = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")
    return [
        run for run in runs if run["deployment_id"] and run["auto_scheduled"] == auto and run["state"]["type"] in final
    ]


def artifacts_of(pages: dict[str, str], run: dict[str, Any]) -> list[dict[str, Any]]:
    return ask(pages, "artifacts/filter", {"artifacts": {"flow_run_id": {"any_": [run["id"]]}}})


def ask(pages: dict[str, str], path: str, question: dict[str, Any]) -> Any:
    return post(f"{pages['prefect']}/api/{path}", question, pages["token"])


def ask_mlflow(pages: dict[str, str], path: str, question: dict[str, Any] | None = None) -> Any:
    return post(f"{pages['mlflow']}/api/2.0/mlflow/{path}", question, pages["token"])


def post(address: str, question: dict[str, Any] | None, token: str) -> Any:
    """Ask a server, by GET without a question; raises OSError with its refusal. One that is busy (503) is asked again."""
    body = None if question is None else json.dumps(question).encode()
    headers = {"content-type": "application/json", "authorization": f"Bearer {token}"}
    until = time.monotonic() + 60
    while True:
        try:
            with urlopen(Request(address, body, headers), timeout=60) as answer:
                return json.load(answer)
        except HTTPError as refusal:
            if refusal.code != 503 or time.monotonic() > until:
                raise
            time.sleep(1)


def wait(done: Callable[[], Any], seconds: float, what: str) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline, f"waited {seconds:.0f} s in vain: {what}"
        time.sleep(1.0)  # to look through all processes, or ask for all runs, costs what the runs could use


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
