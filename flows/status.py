"""`aug3d status`: which machine does what, what waits and why, how long it will take, and what each scene has cost."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Mapping
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.scenes import newest_whole, scenes
from aug3d_core.store.store import Store
from flows.guard import USER
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.preflight import check_servers
from flows.reading import read_store
from flows.refusal import typed_errors
from flows.serving import PASSWORD
from flows.settings import apply_local_environment
from flows.up import is_served
from flows.words import time_words, traffic_words, widened

_API, _AUTH = "PREFECT_API_URL", "PREFECT_API_AUTH_STRING"


def status(
    server: Annotated[
        str,
        typer.Option(
            envvar="AUG3D_SERVER", help="Address of Prefect's pages; without it, those of this home's aug3d up."
        ),
    ] = "",
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Show which machine does what, what waits and why, how long it will take, and what each scene has cost.

    The secret of another machine's server is read from AUG3D_PASSWORD, or from PREFECT_API_AUTH_STRING (user:password).
    """
    with typed_errors(as_json, home):
        store = read_store(home)
        os.environ.update(_server_of(store, server, os.environ))
        check_servers()
        apply_local_environment(store.root)
        # Prefect reads its settings when it is imported, so it is imported after they are set.
        from flows.pool_facts import pool_facts

        facts = {**asyncio.run(pool_facts(store)), "scenes": _costs(store)}
        if as_json:
            print(json.dumps(facts, indent=1))
        else:
            _print(widened(Console()), facts)


def _server_of(store: Store, server: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return how Prefect's server is reached; raises UsageError if there is none."""
    own = {_AUTH: f"{USER}:{environment[PASSWORD]}"} if environment.get(PASSWORD) else {}
    if server:
        return {_API: f"{server.rstrip('/').removesuffix('/api')}/api", **own}
    if environment.get(_API):
        return {_API: environment[_API], **own}
    services = store.root / layout.SERVICES
    none = UsageError(
        f"no aug3d up serves {store.root}",
        "start it, or name the server of another machine with --server http://HOST:4200",
    )
    if not is_served(store.root):
        raise none
    try:
        address = json.loads((services / layout.SERVICES_RUNNING).read_bytes())["prefect"]
        token = (services / layout.SERVICES_TOKEN).read_text() if not own else ""
    except (OSError, ValueError, KeyError) as error:
        raise none from error
    return {_API: f"{address}/api", **(own or {_AUTH: f"{USER}:{token}"})}


def _costs(store: Store) -> list[dict[str, Any]]:
    """Return what the last whole version of each scene has cost."""
    costs = []
    for scene in scenes(store):
        try:
            costs.append({"scene": scene, **_cost(newest_whole(store, scene))})
        except Aug3dError as error:  # a version that is damaged is told by aug3d show
            costs.append({"scene": scene, "problem": error.problem})
    return costs


def _cost(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return what all stages that a version stands on took when they were made, and what its run asked of a shared store."""
    stages = metrics["stages"].values()
    sums = {"processor_s": "cpu_seconds", "seconds": "seconds", "size_mib": "size_mib"}
    totals = {name: round(sum(figures[field] for figures in stages), 1) for name, field in sums.items()}
    return {**totals, "peak_mib": metrics["peak_mib"], "shared_store": metrics.get("shared_store")}


def _print(console: Console, facts: Mapping[str, Any]) -> None:
    console.print(_machines(facts["machines"]))
    if facts["at_work"]:
        console.print(_at_work(facts["at_work"]))
    if facts["waiting"]:
        console.print(_waiting(facts["waiting"]))
    if not facts["at_work"] and not facts["waiting"]:
        console.print("nothing runs, and nothing waits")
    if facts["scenes"]:
        console.print(_scenes(facts["scenes"]))


def _machines(machines: list[dict[str, Any]]) -> Table:
    table = Table("machine, home (queues)", "seen", "does", title="machines")
    for one in machines:
        seen = "online" if one["online"] else f"[red]not for {_duration(one['seen_s_ago'])}[/]"
        table.add_row(escape(one["machine"]), seen, escape(", ".join(one["runs"])) or "-")
    return table


def _at_work(runs: list[dict[str, Any]]) -> Table:
    table = Table("run", "machine", "since (UTC)", "step", "left, at most", title="at work")
    for run in runs:
        percent = "" if run["percent"] is None else f" {run['percent']:.0f} % ({run['doing']})"
        step = ", ".join(run["steps"]) or run["state"]
        unknown = "not known: its first time" if run["scene"] else "-"
        left = unknown if run["left_s"] is None else _duration(run["left_s"])
        table.add_row(escape(run["run"]), escape(run["machine"] or "-"), _clock(run), escape(f"{step}{percent}"), left)
    return table


def _waiting(runs: list[dict[str, Any]]) -> Table:
    table = Table("run", "queue", "since (UTC)", "why", title="waiting")
    for run in runs:
        table.add_row(escape(run["run"]), run["queue"] or "-", _clock(run), escape(run["why"]))
    return table


def _scenes(costs: list[dict[str, Any]]) -> Table:
    table = Table("scene", title="what the last whole version of each scene has cost")
    for heading in ("processor s", "seconds", "peak MiB", "MiB on disk"):
        table.add_column(heading, justify="right")
    table.add_column("asked of the shared store by the run")
    for one in costs:
        if "problem" in one:
            table.add_row(one["scene"], "", "", "", "", f"[red]{escape(one['problem'])}[/]")
            continue
        asked = traffic_words(one["shared_store"]) if one["shared_store"] else "-"
        figures = (one[name] for name in ("processor_s", "seconds", "peak_mib", "size_mib"))
        table.add_row(one["scene"], *(f"{figure:,.0f}" for figure in figures), asked)
    return table


def _clock(run: Mapping[str, Any]) -> str:
    return str(run["since"])[:19].replace("T", " ")


def _duration(seconds: float | None) -> str:
    return "ever" if seconds is None else time_words(seconds)
