"""A page of another site, in the browser of an owner who is signed in, attacks a running `aug3d up` and gets nothing.

It asks from another origin, from another port of this machine, and from a name that was rebound to this machine.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml
from playwright.sync_api import BrowserContext, Page, expect, sync_playwright

from aug3d_core.bench.small_town import SETTINGS
from tests.infra.postgres import free_port
from tests.journeys.test_daily_use import post
from tests.tests_support import hear_signals, words_of

CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed"),
]
_EVIL = "evil.example"
_CHROMIUM = (
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
    f"--host-resolver-rules=MAP {_EVIL} 127.0.0.1",
)  # fmt: skip
# What such a page can do: it returns what it read, and what was opened to it.
_ATTACK = """async (at) => {
  const got = [];
  const body = JSON.stringify({name: "attacked", value: 1, tags: []});
  const tries = [
    {}, {credentials: "include"}, {mode: "no-cors", credentials: "include"},
    {method: "POST", body, headers: {"Content-Type": "application/json"}, credentials: "include"},
    {method: "POST", body, headers: {"Content-Type": "text/plain"}, credentials: "include"},
    {method: "POST", body, mode: "no-cors", credentials: "include"},
    {method: "POST", body: new URLSearchParams({name: "attacked"}), credentials: "include"},
    {method: "PUT", body, credentials: "include"}, {method: "DELETE", credentials: "include"},
  ];
  for (const path of at.paths) for (const how of tries) {
    try {
      const answer = await fetch(at.server + path, how);
      const text = await answer.text();
      if (answer.ok && text) got.push(`${how.method || "GET"} ${path}: ${text.slice(0, 80)}`);
    } catch (refused) {}
  }
  navigator.sendBeacon(at.server + at.paths[0], body);
  for (const kind of ["img", "script", "iframe", "link", "object"]) {
    await new Promise(done => {
      const part = document.createElement(kind);
      part.onload = () => { if (kind != "iframe" && kind != "object") got.push(`${kind} was loaded`); done(); };
      part.onerror = done;
      setTimeout(done, 1500);
      if (kind == "link") { part.rel = "stylesheet"; part.href = at.server + "/"; }
      else if (kind == "object") part.data = at.server + "/";
      else part.src = at.server + "/";
      document.body.append(part);
    });
  }
  for (const path of ["/api/events/out", "/api/logs/out", "/api/events/in"]) for (const protocol of [[], ["prefect"]]) {
    const opened = await new Promise(done => {
      const socket = new WebSocket(at.server.replace("http", "ws") + path, protocol);
      socket.onopen = () => done(true);
      socket.onerror = socket.onclose = () => done(false);
      setTimeout(() => done(false), 3000);
    });
    if (opened) got.push(`socket ${path} was opened`);
  }
  return got;
}"""
_FORM = """at => {
  const form = document.createElement("form");
  form.method = "post"; form.action = at.server + at.paths[0]; form.enctype = "text/plain";
  const field = document.createElement("input");
  field.name = '{"name": "attacked", "value": "'; field.value = '"}';
  form.append(field); document.body.append(form); form.submit();
}"""


@dataclass
class Up:
    """A running `aug3d up`: its process, what it printed, and the token."""

    process: subprocess.Popen
    home: Path
    told: dict[str, Any]

    @property
    def token(self) -> str:
        """Return what the printed address ends with."""
        return self.told["open"]["prefect"].partition("token=")[2]

    def attacked(self) -> dict[str, str]:
        """Return for both servers what an attack would change: a variable of Prefect's, an experiment of MLflow's."""
        return {"prefect": "/api/variables/", "mlflow": "/api/2.0/mlflow/experiments/create"}

    def ask(self, server: str, path: str, question: dict[str, Any]) -> Any:
        """Post to a server as its owner."""
        return post(self.told[server] + path, question, self.token)

    def why_nothing_runs(self) -> str:
        """Return the states of all runs, and what the services wrote last."""
        runs = [(run["name"], run["state"]) for run in self.ask("prefect", "/api/flow_runs/filter", {})]
        logs = [log.read_text()[-2000:] for log in sorted((self.home / "services").glob("*.log"))]
        return "\n".join(["no stage is at work", *map(str, runs), *logs])

    def changed(self) -> list[Any]:
        """Return what the attack has made."""
        experiments = self.ask("mlflow", "/api/2.0/mlflow/experiments/search", {"max_results": 100})["experiments"]
        return [
            *self.ask("prefect", "/api/variables/filter", {}),
            *[one["name"] for one in experiments if one["name"] != "Default"],
        ]


@pytest.fixture(scope="module")
def up(own_environment: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    home = tmp_path_factory.mktemp("attacked")
    (home / "scenes").mkdir()
    (home / "scenes" / "town.yaml").write_text(yaml.safe_dump({"photos": None, "settings": SETTINGS}))
    aug3d = [str(Path(sys.executable).parent / "aug3d"), "up", "--json", "--home", str(home)]
    ports = ["--prefect-port", str(free_port()), "--mlflow-port", str(free_port())]
    with subprocess.Popen(
        [*aug3d, *ports], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, preexec_fn=hear_signals
    ) as process:
        try:
            told = json.loads(process.stdout.readline())  # type: ignore[union-attr]
            yield Up(process, home, told)
        finally:
            process.terminate()
            process.wait(60)


@pytest.fixture(scope="module")
def context(up: Up) -> Iterator[BrowserContext]:
    """Return a browser that the printed address has signed in."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_CHROMIUM)
        context = browser.new_context()
        yield context
        browser.close()


@pytest.fixture(scope="module")
def other_site() -> Iterator[int]:
    """Serve an empty page, as another site or another program of this machine; yields its port."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>kittens</title><body>kittens</body>")

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Page) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


@pytest.fixture
def page(context: BrowserContext) -> Iterator[Page]:
    page = context.new_page()
    page.set_default_timeout(60_000)
    expect.set_options(timeout=60_000)  # the line above does not cover it, and 5 s are too few on a busy machine
    yield page
    page.close()


def test_without_the_token_a_browser_sees_the_sign_in_page(up: Up, page: Page) -> None:
    for server in ("prefect", "mlflow"):
        answer = page.goto(up.told[server])
        assert answer is not None and answer.status == 401
        expect(page.get_by_label("Password or token")).to_be_visible()


def test_the_printed_address_opens_both_pages_and_a_bookmark_works_afterwards(up: Up, page: Page) -> None:
    page.goto(up.told["open"]["prefect"])
    expect(page).to_have_title(re.compile("Prefect"))
    expect(page.get_by_text("Flows", exact=True).first).to_be_visible()
    assert "token" not in page.url
    page.goto(up.told["mlflow"])  # the same cookie
    expect(page.get_by_text("Experiments").first).to_be_visible()
    page.goto(f"{up.told['prefect']}/deployments")
    expect(page.get_by_text("tradeoff").first).to_be_visible()
    assert "token" not in page.evaluate("document.cookie"), "no script reads the cookie"


@pytest.mark.parametrize("server", ["prefect", "mlflow"])
@pytest.mark.parametrize("site", [_EVIL, "127.0.0.1"])
def test_a_page_of_another_origin_gets_nothing(server: str, site: str, up: Up, page: Page, other_site: int) -> None:
    at = {"server": up.told[server], "paths": [up.attacked()[server], "/", "/api/admin/settings"]}
    page.goto(f"http://{site}:{other_site}/")
    assert page.evaluate(_ATTACK, at) == []
    with page.expect_navigation():
        page.evaluate(_FORM, at)
    assert "attacked" not in page.content()
    assert up.changed() == []


@pytest.mark.parametrize("server", ["prefect", "mlflow"])
def test_a_rebound_name_gets_nothing(server: str, up: Up, page: Page) -> None:
    address = up.told[server].replace("127.0.0.1", _EVIL)
    for path in ("/", f"/?token={up.token}"):
        answer = page.goto(address + path)
        assert answer is not None and answer.status == 403
    at = {"server": address, "paths": [up.attacked()[server], "/", "/health", "/api/health", "/api/admin/settings"]}
    assert page.evaluate(_ATTACK, at) == [], "now it is of the same origin to the browser"
    assert up.changed() == []


def test_the_token_is_in_no_command_line_and_in_no_file_that_others_read(up: Up) -> None:
    for process in psutil.Process(up.process.pid).children(recursive=True):
        assert up.token not in " ".join(words_of(process))
    assert (up.home / "services" / "token").stat().st_mode & 0o077 == 0
    assert (up.home / "services").stat().st_mode & 0o077 == 0
    logs = [*(up.home / "services").glob("*.log"), up.home / "services" / "up.json"]
    assert len(logs) == 4 and not any(up.token in log.read_text() for log in logs)


def test_killed_it_leaves_no_process(up: Up) -> None:
    """SIGKILL, with a run under way: servers, worker, and the process of the run."""
    deployment = next(d for d in up.ask("prefect", "/api/deployments/filter", {}) if d["name"] == "town")
    up.ask("prefect", f"/api/deployments/{deployment['id']}/create_flow_run", {})
    deadline = time.monotonic() + 300
    while not list((up.home / "work").glob("*/*/log.txt")):
        assert time.monotonic() < deadline, up.why_nothing_runs()
        time.sleep(0.1)
    family = psutil.Process(up.process.pid).children(recursive=True)
    assert any("prefect.engine" in words_of(member) for member in family)
    assert len(family) >= 5, "both servers, the worker, the process of a run, that of a stage"
    os.kill(up.process.pid, signal.SIGKILL)
    up.process.wait()
    _, left = psutil.wait_procs(family, timeout=10)
    assert not left
