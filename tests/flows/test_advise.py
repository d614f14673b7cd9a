"""`aug3d advise`: what it tells people, it tells programs too."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import aug3d_core.advice.page  # noqa: F401  (the command loads it when it is called, and Open3D with it)
from aug3d_core.advice.choice import Advised, Choice
from aug3d_core.advice.plan import Plan
from aug3d_core.store.store import Store
from flows import advise
from flows.cli import app
from tests.advice.flown_site import ORIGIN, site, views, write_scene


def plan(gps: bool) -> Plan:
    some = np.full(len(site().samples.xyz), 0.9)
    one = Advised(1, (0.0, 0.0, 72.0), 0.0, -90.0, 0.1, 0.5, 0.0, 1.0)
    made = Plan(site(), views(), Choice((one,), (0.3, 0.2), some, some), "m", np.array([*ORIGIN.values()]))
    return made if gps else replace(made, origin=None)


@pytest.mark.parametrize("gps", [True, False])
def test_programs_get_the_verdict_and_the_notes_that_people_get(
    gps: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = dict(zip(("sfm", "surface"), write_scene(tmp_path / "scene", gps=gps), strict=True))
    monkeypatch.setattr(advise, "version_with", lambda store, scene, *steps: tmp_path)
    monkeypatch.setattr(advise, "object_of", lambda store, version, stage: stage)
    monkeypatch.setattr(advise, "records_of", lambda store, version: {})
    monkeypatch.setattr(Store, "files_dir", lambda self, record, names: folders[record])
    monkeypatch.setattr("aug3d_core.advice.plan.plan_of", lambda *args: plan(gps))
    (tmp_path / "home").mkdir()
    words = ["--home", str(tmp_path / "home")]
    for_people = CliRunner().invoke(app, ["advise", "town", str(tmp_path / "one"), *words])
    for_programs = CliRunner().invoke(app, ["advise", "town", str(tmp_path / "other"), *words, "--json"])
    assert for_people.exit_code == for_programs.exit_code == 0, for_people.output + for_programs.output
    told = json.loads(for_programs.stdout)
    printed = " ".join(for_people.stdout.split())
    assert told["verdict"] in printed and "poorly photographed" in told["verdict"]
    assert len(told["notes"]) == 1 == printed.count("note ") and told["notes"][0] in printed
    assert told["notes"][0].startswith("Do not take off below 540 m" if gps else "no GPS")
    assert told["take_off_m"] == (pytest.approx(540, abs=0.2) if gps else None)
