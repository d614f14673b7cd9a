# ruff: noqa: E501  (tables of inputs)
"""Malformed parameters through Prefect's API, for every flow with a deployment.

Prefect refuses them, also where the sender asks it not to look, or the run ends as failed in the project's own words; nothing
is written outside the home, no run hangs, and the worker goes on with the others.
"""

from __future__ import annotations

import asyncio
import contextvars
import json
import math
import os
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import pytest

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import Aug3dError
from aug3d_core.scene_files import SceneEntry, read_scene, write_scene
from aug3d_core.store.store import Store
from tests.attack.inputs import HANG, SILENT, TRACEBACK

pytestmark = [pytest.mark.attack, pytest.mark.slow, pytest.mark.usefixtures("prefect")]

LIMIT_S = 60.0
BY_PREFECT, BY_TYPE, WORDS = "refused by Prefect", "refused by the flow's types", "refused in words"
UNREAD = "refused before the flow begins"  # by Prefect too, which calls such a run crashed
_HELD = (BY_PREFECT, BY_TYPE, WORDS)
_MOST_SAID = 10_000  # the words of every perturbation to choose from
_ENDED_WITHIN_S = 300.0  # runs that a worker takes
_LONG = "x" * 100_000
_NAMES: dict[str, Any] = {
    "unknown": "nowhere", "empty": "", "parent": "../../etc", "absolute": "/etc/passwd", "NUL": "a\0b", "newline": "one\nforged: yes",
    "tag": "!!python/object/apply:os.system ['touch x']", "template": "{{ 1/0 }}", "format": "{scene.__class__}", "long": _LONG,
    "spaces": " one ", "bidi": "one\u202e", "option": "--help",
}  # fmt: skip
_NO_TEXT: dict[str, Any] = {"null": None, "number": 7, "list": ["one"], "object": {"a": 1}, "NaN": math.nan}
_NO_COUNT: dict[str, Any] = {
    "zero": 0, "many": 10**9, "huge": 10**400, "NaN": math.nan, "infinity": math.inf, "half": 2.5, "digits": "9" * 5000, "null": None,
}  # fmt: skip
_NO_PSNR: dict[str, Any] = {  # NaN and infinity are no JSON, and Prefect may keep null for them: no target
    "NaN as text": "nan", "text": "much", "huge": 10**400, "list": [1], "negative": -1e9,
}  # fmt: skip
_MORE: dict[str, Any] = {"magic": 1, "home": "/etc", "self": 1}


def _deep(levels: int) -> Any:
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


def _settings(values: dict[str, Any]) -> dict[str, Any]:
    """Return malformed settings of a scene, made of good ones."""
    training = values["training"]

    def changed(**fields: Any) -> dict[str, Any]:
        return {**values, "training": {**training, **fields}}

    return {
        "text": "tiny", "null": None, "empty": {}, "deep": _deep(200), "unknown stage": {**values, "magic": {"on": True}},
        "stage list": {**values, "sfm": []}, "unknown field": changed(magic=1), "steps text": changed(steps="many"),
        "steps negative": changed(steps=-5), "steps NaN": changed(steps=math.nan), "steps huge": changed(steps=10**400),
        "steps deep": changed(steps=_deep(200)), "head": changed(head={"name": "magic"}), "head path": changed(head={"name": "../x"}),
        "start": changed(head={**training["head"], "start": 7}), "auto": {**values, "auto": ["magic"]},
        "jinja": {**values, "training": {"__prefect_kind": "jinja", "template": "{{ 1/0 }}"}},
        "json": {**values, "training": {"__prefect_kind": "json", "value": "{"}},
        "variable": {**values, "training": {"__prefect_kind": "workspace_variable", "variable_name": "nothing"}},
    }  # fmt: skip


def _attacks(values: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield deployment, what is wrong, and malformed parameters."""
    one = ("unknown", "parent", "NUL", "long")
    names = {name: _NAMES[name] for name in one} | _NO_TEXT
    lists: dict[str, Any] = {
        "text": "one", "object": {"one": 1}, "many": ["nowhere"] * 10_000, "deep": _deep(200), "among good": ["one", "../x"],
    }  # fmt: skip
    lists |= {f"of {name}": [value] for name, value in names.items()}
    wrong: dict[str, dict[str, dict[str, Any]]] = {
        "regenerate/one": {"settings": _settings(values), "scene": names},
        "collection/all": {"collection": names},
        "regenerate scenes/all scenes": {"scenes": lists | {name: [value] for name, value in _NAMES.items()}},
        "study/grouping": {"scene": names, "study": {"other": "magic", **_NO_TEXT}, "seeds": _NO_COUNT},
        "tradeoff/tradeoff": {"scenes": lists, "only": lists | {"empty": [""]}, "target_db": _NO_PSNR},
        "stability/stability": {"only": {"empty": [""], "unknown": ["magic"]}, "seeds": _NO_COUNT, "quick": {"text": "x", "list": []}},
    }  # fmt: skip
    runs = names | {"of nobody": "00000000-0000-4000-8000-000000000000"}
    wrong |= {"share of a study/for a worker": {"study": runs}, "help with a scene/for a worker": {"run": runs}}
    for deployment, parameters in wrong.items():
        given = {"study/grouping": {"scene": "one"}, "help with a scene/for a worker": {"step": "depth", "key": "k"}}
        for parameter, sets in {**parameters, **{name: {"too many": value} for name, value in _MORE.items()}}.items():
            for about, value in sets.items():
                yield deployment, f"{parameter} {about}", {**given.get(deployment, {}), parameter: value}
    yield "study/grouping", "no scene", {}


class _Began(BaseException):
    """Work began: the parameters were taken."""


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Return a home with a scene and a collection, where no work may begin."""
    store = Store(tmp_path / "home")
    monkeypatch.setenv("AUG3D_HOME", str(store.root))
    write_scene(store, "one", SceneEntry(photos=None))
    COLLECTIONS.add(store, "all", CollectionEntry(train=("one",)))

    def began(*_: object, **__: object) -> None:
        raise _Began

    monkeypatch.setattr("tasks.build_task.build", began)
    return store


@pytest.fixture
def deployed(store: Store) -> dict[str, Any]:
    """Return the id of each deployment by flow and name; what other tests left to do on this server is dropped."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter
    from prefect.states import Cancelled

    from flows.deployments import of_collection, of_everything, of_scene
    from flows.pool import make_pool
    from flows.takeover import unfinished

    async def apply() -> dict[str, Any]:
        async with get_client() as client:
            await make_pool(client)
            while left := await client.read_flow_runs(flow_run_filter=FlowRunFilter(state=unfinished())):
                for run in left:
                    await client.set_flow_run_state(run.id, Cancelled(), force=True)
        made = [
            await of_scene("one", read_scene(store, "one")),
            await of_collection("all", COLLECTIONS.read(store, "all")),
        ]
        made += [deployment async for deployment in of_everything()]
        return {deployment.full_name: await deployment.aapply() for deployment in made}

    return asyncio.run(apply())


def _flows() -> dict[str, Any]:
    from flows.collection_run import train_collection
    from flows.help_run import help_with
    from flows.regenerate import batch, regenerate
    from flows.study_run import share, stability, study_scene, tradeoff

    known = regenerate, batch, train_collection, study_scene, tradeoff, stability, share, help_with
    return {one.name: one for one in known}


def _post(deployment: Any, parameters: Any, enforce: bool) -> httpx.Response:
    """Ask for a run as any program may, again where Prefect's database was busy."""
    body = json.dumps({"parameters": parameters, "enforce_parameter_schema": enforce, "tags": ["aug3d"]})
    user, _, password = os.environ["PREFECT_API_AUTH_STRING"].partition(":")
    for _ in range(5):
        answer = httpx.post(
            f"{os.environ['PREFECT_API_URL']}/deployments/{deployment}/create_flow_run",
            content=body.encode(),
            headers={"Content-Type": "application/json"},
            auth=(user, password),
            timeout=LIMIT_S,
        )
        if answer.status_code != httpx.codes.SERVICE_UNAVAILABLE:
            break
    return answer


def _end(flow: Any, run_id: str) -> Any:
    """Run a flow run as the worker's process does, and return its last state, or what it raised."""
    from prefect.client.orchestration import get_client
    from prefect.flow_engine import run_flow

    ended: list[Any] = []
    with get_client(sync_client=True) as client:
        run = client.read_flow_run(UUID(run_id))

    def go() -> None:
        try:
            ended.append(run_flow(flow, flow_run=run, return_type="state"))
        except BaseException as error:
            ended.append(error)

    thread = threading.Thread(target=contextvars.copy_context().run, args=(go,), daemon=True)
    thread.start()
    thread.join(LIMIT_S)
    return ended[0] if ended else None


def _verdict(flow: Any, deployment: Any, parameters: Any, enforce: bool) -> tuple[str, str]:
    """Return what became of parameters, and what was said."""
    from prefect.client.orchestration import get_client
    from prefect.exceptions import ParameterBindError, ParameterTypeError, SignatureMismatchError

    answer = _post(deployment, parameters, enforce)
    if 400 <= answer.status_code < 500:
        return BY_PREFECT, answer.text
    if answer.status_code != 201:
        return f"HTTP {answer.status_code}", answer.text
    state = _end(flow, answer.json()["id"])
    if state is None:
        return HANG, f"no end in {LIMIT_S:g} s"
    if isinstance(state, SignatureMismatchError | ParameterBindError):
        with get_client(sync_client=True) as client:  # the worker would call it crashed
            client.delete_flow_run(UUID(answer.json()["id"]))
        return UNREAD, str(state)
    if isinstance(state, BaseException):
        return TRACEBACK, f"{type(state).__name__}: {state}"
    if not state.is_failed() or state.is_crashed():
        return SILENT, f"{state.name}: {state.message}"
    try:
        state.result()
    except Aug3dError as error:
        return WORDS, str(error)
    except ParameterTypeError as error:
        return BY_TYPE, str(error)
    except Exception as error:
        return TRACEBACK, f"{type(error).__name__}: {state.message}"
    return WORDS, state.message or ""


@pytest.mark.long
def test_parameters(store: Store, deployed: dict[str, Any], tmp_path: Path) -> None:
    flows, counts, bad = _flows(), Counter[str](), []
    attacks = list(_attacks(SceneEntry(photos=None).config().model_dump(mode="json")))
    assert {name.partition("/")[0] for name, _, _ in attacks} == set(flows) and len(attacks) >= 150
    for name, about, parameters in attacks:
        for enforce in (True, False):
            what, said = _verdict(flows[name.partition("/")[0]], deployed[name], parameters, enforce)
            counts[what] += 1
            if what not in _HELD and not (what == UNREAD and not enforce):
                bad.append(f"{what}: {name}: {about}, {'asked' if enforce else 'not asked'} to look: {said[:300]}")
            if what == WORDS and len(said) > _MOST_SAID:
                bad.append(f"{len(said)} characters: {name}: {about}: {said[:100]}")
            if what != BY_PREFECT:
                break  # it was let in though Prefect looked: without a look it is the same
    print(f"\n{len(attacks)} malformed parameters: {dict(counts)}")
    assert not bad, f"{len(bad)} of {counts.total()}:\n" + "\n".join(bad)
    assert [path.name for path in tmp_path.iterdir()] == ["home"]
    begun, _ = _verdict(flows["regenerate"], deployed["regenerate/one"], {}, True)
    assert begun == TRACEBACK, "what is right begins work, which is told from a refusal"


def test_the_worker_goes_on_with_the_others(store: Store, deployed: dict[str, Any]) -> None:
    """A real worker: what is malformed fails or crashes, the good run that came last is done."""
    from prefect.client.orchestration import get_client

    (store.root / "scenes" / "one.yaml").unlink()
    asked = {
        "study/grouping": ({"scene": "../../etc"}, True),
        "tradeoff/tradeoff": ({"magic": 1}, False),
        "regenerate scenes/all scenes": ({}, True),
    }
    runs = {name: _post(deployed[name], *how).json()["id"] for name, how in asked.items()}
    worker = subprocess.Popen([sys.executable, "-m", "flows.worker"], cwd=Path(__file__).parents[2])
    ended: dict[str, Any] = {}
    try:
        with get_client(sync_client=True) as client:
            until = time.monotonic() + _ENDED_WITHIN_S
            while worker.poll() is None and not (ended and all(state.is_final() for state in ended.values())):
                assert time.monotonic() < until, {name: state.name for name, state in ended.items()}
                time.sleep(0.5)
                ended = {name: client.read_flow_run(UUID(run)).state for name, run in runs.items()}
        assert worker.poll() is None, "the worker lives on"
    finally:
        worker.terminate()
        worker.wait(60)
    assert {name: state.name for name, state in ended.items()} == {
        "study/grouping": "Failed", "tradeoff/tradeoff": "Failed", "regenerate scenes/all scenes": "Completed",
    }  # fmt: skip
    assert "is not a scene name" in ended["study/grouping"].message
    assert "there is no parameter 'magic' -> ask again with values for: scenes," in ended["tradeoff/tradeoff"].message
