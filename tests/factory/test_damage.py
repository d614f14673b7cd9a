"""Bits that rot in the store: what is read is compared with its digest, and what is damaged is made again."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.factory.build import Built, build
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, planned, walk
from aug3d_core.store.damage import DamagedError
from aug3d_core.store.store import Store
from tests.flows.stand_in import FEW, Stages
from tests.stand_in_stages import MADE
from tests.tests_support import flip

CONFIG = scene_config("tiny")


class Salted(Stages):
    """Stages whose files differ from one making to the next, where there is a salt."""

    salt = ""

    def figures(self, stage, made, files):
        (files / "salt").write_text(self.salt if stage.name == "grouping" else "")
        return super().figures(stage, made, files)


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Salted:
    stand_in = Salted(folds=1)
    monkeypatch.setattr("aug3d_core.factory.build._compute", lambda store, work, *_: stand_in._compute(store, work))
    monkeypatch.setattr(Material, "stages", lambda _: FEW)
    return stand_in


@pytest.fixture
def material(tmp_path: Path) -> Material:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"a photograph")
    return Material(photos=tmp_path / "photos")


def made(store: Store, material: Material, plan: bool = False) -> dict[str, Built]:
    """Run the scene and return what was built of each step."""

    def make(visit: Visit) -> Built:
        assert visit.work
        return build(store, visit.work, lambda *_: None)

    known = {visit.step.name: visit for visit in planned(store, material, CONFIG)} if plan else None
    return {v.step.name: v.built for v in walk(store, FEW, CONFIG, material, make, plan=known) if v.built}


@pytest.mark.parametrize("plan", [False, True])
@pytest.mark.parametrize("step", [stage.name for stage in FEW])
def test_a_rotten_object_is_made_again_and_the_run_says_so(
    stages: Salted, material: Material, tmp_path: Path, step: str, plan: bool
) -> None:
    store = Store(tmp_path / "home")
    first = made(store, material)[step]
    flip(store.place(first.record) / MADE)
    stages.computed.clear()
    again = made(store, material, plan)
    assert stages.computed == [step], "what follows reads the same bytes and stays"
    assert (
        again[step].damage == f"{MADE} holds other bytes than were written: it was made again, byte for byte the same"
    )
    assert again[step].record.digest == first.record.digest
    assert [built.damage for name, built in again.items() if name != step] == [""] * (len(FEW) - 1)
    stages.computed.clear()
    assert all(built.cached for built in made(store, material).values()) and not stages.computed


@pytest.mark.parametrize("plan", [False, True])
def test_what_follows_from_other_bytes_is_made_again_too(
    stages: Salted, material: Material, tmp_path: Path, plan: bool
) -> None:
    store = Store(tmp_path / "home")
    flip(store.place(made(store, material)["grouping"].record) / MADE)
    stages.salt = "other"
    stages.computed.clear()
    again = made(store, material, plan)
    assert stages.computed == ["grouping", "depth", "training", "evaluation"], (
        "the depth is the same, and so is its surface"
    )
    assert again["grouping"].damage.endswith("with other bytes, and so is what follows from it")


def test_what_the_scene_was_made_of_before_goes_with_the_work(
    stages: Salted, material: Material, tmp_path: Path
) -> None:
    store = Store(tmp_path / "home")
    before = {step: built.record for step, built in made(store, material).items()}
    plan = {visit.step.name: visit for visit in planned(store, material, CONFIG)}
    visits = list(walk(store, FEW, CONFIG, material, lambda visit: visit.built, plan=plan, before=before))
    assert {visit.step.name: visit.work and visit.work.before for visit in visits} == before


def test_an_input_is_compared_with_its_digest_before_a_stage_reads_it(
    stages: Salted, material: Material, tmp_path: Path
) -> None:
    store = Store(tmp_path / "home")
    visits = list(walk(store, FEW, CONFIG, material, lambda v: build(store, v.work, lambda *_: None)))  # type: ignore[arg-type]
    work = visits[-1].work
    assert work and visits[0].record
    flip(store.place(visits[1].record) / MADE)  # type: ignore[arg-type]
    with pytest.raises(DamagedError, match=r"made\.json holds other bytes"):
        build(store, work.afresh(), lambda *_: None)


def test_a_dry_run_reads_no_file(stages: Salted, material: Material, tmp_path: Path) -> None:
    store = Store(tmp_path / "home")
    flip(store.place(made(store, material)["grouping"].record) / MADE)
    assert all(visit.cached for visit in planned(store, material, CONFIG))
