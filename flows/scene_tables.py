"""The registry as a person reads it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flows.summary import command
from flows.words import widened


def print_scenes(console: Console, facts: list[dict[str, Any]], others: list[str], home: Path) -> None:
    """Print a row for each scene, below it what is wrong with any of them, and scenes that only `aug3d run` knows."""
    console = widened(console)
    if facts:
        console.print(_scenes_table(facts))
    else:
        console.print(
            f"no scenes yet: {command(home, 'scenes', 'add', 'my_scene', '--photos', 'DIR')}",
            highlight=False,
            soft_wrap=True,
        )
    for fact in facts:
        if fact["problem"]:
            console.print(f"[red]{fact['state']}[/] {escape(fact['problem'])}", highlight=False, soft_wrap=True)
    if others:
        console.print(f"made, but not in the registry: {', '.join(others)}", highlight=False)


def print_scene(console: Console, facts: dict[str, Any]) -> None:
    """Print everything the registry and the store say of one scene."""
    console = widened(console)
    lines = {
        "file": facts["file"],
        "photographs": _photos(facts),
        "poses": facts["poses"],
        "licence": facts["licence"] or "not said",
        "description": facts["description"],
        "tags": ", ".join(facts["tags"]),
        "schedule": facts["when"] + (f", next {moment(facts)}" if facts["next"] else ""),
        "publishing": f"a version may lose {facts['publish']['most_psnr_drop_db']:g} dB of PSNR",
        "preset": facts["preset"] + (", but:" if facts["changes"] else ""),
    }
    for name, value in lines.items():
        if value:
            console.print(f"{name:>11}  {escape(value)}", highlight=False, soft_wrap=True)
    for name, change in facts["changes"].items():
        change_told = f"{name} = {change['value']} (preset: {change['preset']})"
        console.print(f"{'':>11}  {escape(change_told)}", highlight=False, soft_wrap=True)
    if facts["problem"]:
        console.print(f"[red]{facts['state']:>11}[/]  {escape(facts['problem'])}", highlight=False, soft_wrap=True)
    console.print(_versions_table(facts) if facts["versions"] else "no versions yet", highlight=False)


def moment(facts: dict[str, Any]) -> str:
    """Return the next start as people write it, in the schedule's time zone."""
    return datetime.fromisoformat(facts["next"]).strftime("%a %Y-%m-%d %H:%M")


def _scenes_table(facts: list[dict[str, Any]]) -> Table:
    table = Table(title="scenes")
    for heading in ("scene", "photographs", "preset", "schedule", "last version"):
        table.add_column(heading, overflow="fold")  # a path that is cut names nothing
    table.add_column("PSNR dB", justify="right")
    table.add_column("published", overflow="fold")
    for fact in facts:
        if fact["state"] == "wrong":
            table.add_row(fact["scene"], "[red]file with a mistake[/]", "", "", *_made(fact))
            continue
        schedule = fact["when"] + (f"\nnext {moment(fact)}" if fact["next"] else "")
        photos = f"{'[red]' if fact['photos'] and fact['photo_count'] is None else ''}{escape(_photos(fact))}"
        table.add_row(fact["scene"], photos, fact["preset"], schedule, *_made(fact))
    return table


def _photos(facts: dict[str, Any]) -> str:
    if facts["photos"] is None:
        return "built-in town"
    count = "gone:" if facts["photo_count"] is None else f"{facts['photo_count']} in"
    return f"{count} {facts['photos']}"


def _made(facts: dict[str, Any]) -> tuple[str, str, str]:
    if not facts["versions"]:
        return "none", "-", "-"
    last = facts["versions"][-1]
    published = "the same" if facts["published"] == last["version"] else facts["published"]
    return f"{last['version']} {last['state']}", _psnr(last), published or "-"


def _versions_table(facts: dict[str, Any]) -> Table:
    table = Table("version", "state", "preset")
    table.add_column("PSNR dB", justify="right")
    table.add_column("seconds", justify="right")
    table.add_column("")
    for version in facts["versions"]:
        mark = "published" if version["version"] == facts["published"] else ""
        table.add_row(
            version["version"], version["state"], version["preset"], _psnr(version), f"{version['seconds']:.0f}", mark
        )
    return table


def _psnr(version: dict[str, Any]) -> str:
    return "-" if version["psnr_db"] is None else f"{version['psnr_db']:.2f}"
