"""What a person finds in the Prefect UI: a table per stage, its pictures, and links."""

from __future__ import annotations

import base64
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from prefect.artifacts import (
    create_markdown_artifact,
    create_progress_artifact,
    create_table_artifact,
    update_progress_artifact,
)
from prefect.runtime import flow_run

from aug3d_core.metrics.comparison import Comparison, change_text, psnr_words
from aug3d_core.report.thumbnails import is_film, thumbnail_jpeg
from aug3d_core.run.progress import failures_logged
from aug3d_core.store import layout
from aug3d_core.store.store import Store

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit

_TELL_EVERY_S = 2.0


def publish(store: Store, made: Visit) -> None:
    """Leave a step's figures and pictures with the flow run."""
    record = made.record
    rows = [
        {"what": "state", "value": record.state},
        {"what": "cached", "value": made.cached},
        {"what": "seconds", "value": record.seconds},
        {"what": "peak_mib", "value": record.peak_mib},
        {"what": "folder", "value": str(store.place(record))},
        *({"what": name, "value": value} for name, value in record.metrics.items()),
    ]
    accuracy = made.step.stage.accuracy
    told = f"{accuracy.replace('_', ' ')}: {record.metrics.get(accuracy)}"
    create_table_artifact(
        key=artifact_key(made.step.name, "figures"), table=rows, description="\n\n".join((told, *record.notes))
    )
    # Films are in the report and in MLflow: an artifact's Markdown cannot play them
    if stills := {caption: path for caption, path in record.pictures.items() if not is_film(path)}:
        sections = [
            f"### {caption}\n\n![{caption}]({_embedded(store.file(record, path))})" for caption, path in stills.items()
        ]
        create_markdown_artifact(
            key=artifact_key(made.step.name, "pictures"),
            markdown="\n\n".join(sections),
            description=", ".join(stills),
        )


def artifact_key(*words: str) -> str:
    """Return a key that Prefect takes, of lower-case letters, digits and dashes; it begins with the run's scene."""
    scene = flow_run.get_parameters().get("scene") or ""
    return re.sub("[^a-z0-9]+", "-", " ".join((scene, *words)).lower()).strip("-")


def publish_changes(scene: str, metrics: Mapping[str, Any] | None) -> None:
    """Leave one table that says what was made again and why; `metrics` is None if nothing was."""
    stages = metrics["stages"] if metrics else {}
    rows = [
        {
            "step": name,
            "this run": "found made" if figures["cached"] else "made",
            "seconds": "" if figures["cached"] else figures["seconds"],
            "what changed": ", ".join(figures["why"]) or "nothing",
        }
        for name, figures in stages.items()
    ]
    made = sum(not figures["cached"] for figures in stages.values())
    words = f"{made} of {len(rows)} steps were made" if rows else "Nothing changed since the published version"
    rows = rows or [{"step": "all", "this run": "found made", "seconds": "", "what changed": "nothing"}]
    create_table_artifact(key=artifact_key("what changed"), table=rows, description=f"{scene}: {words}")


def publish_comparison(compared: Comparison) -> None:
    """Leave a table of what differs from the published version, the first of the two."""
    rows = [
        {"figure": row.name, "published": row.values[0], "now": row.values[1], "change": change_text(row, 1)}
        for row in (*compared.headline, *compared.params)
    ]
    told = (
        f"the scores cannot be compared: {compared.not_comparable}"
        if compared.not_comparable
        else psnr_words(compared, 1)
    )
    beside = f"Beside {compared.runs[0]}" + (f": {told}" if told else "")
    create_table_artifact(key=artifact_key("beside published"), table=rows, description=beside)


def publish_batch(ends: Mapping[str, tuple[str, str]]) -> None:
    """Leave the summary of a batch: the last state of each scene, and what it says."""
    rows = [{"scene": scene, "state": state, "what": what} for scene, (state, what) in ends.items()]
    create_table_artifact(key=artifact_key("summary of scenes"), table=rows, description=f"{len(rows)} scenes")


def publish_study(folder: Path, question: str) -> None:
    """Leave the chart of a study, and where its page is."""
    chart, page = _embedded(folder / layout.STUDY_CHART), folder / layout.STUDY_PAGE
    create_markdown_artifact(key=artifact_key("study"), markdown=f"# {question}\n\n![chart]({chart})\n\nPage: `{page}`")


class PrefectProgress:
    """A progress listener that shows in the Prefect UI how far each step is."""

    def __init__(self) -> None:
        """Begin with no step."""
        self._of: dict[str, UUID] = {}
        self._told = 0.0

    def started(self, step: str) -> None:
        """A step that turns out to be cached has no progress."""

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """Tell the first of a step, then at most every two seconds: each is a call to the server. One that fails is logged."""
        if step in self._of and time.monotonic() - self._told < _TELL_EVERY_S:
            return
        self._told = time.monotonic()
        with failures_logged():
            self._tell(step, done, total, what)

    def _tell(self, step: str, done: int, total: int, what: str) -> None:
        percent = 100.0 * done / max(total, 1)
        if step in self._of:
            update_progress_artifact(self._of[step], percent, description=f"{step}: {what}")
        else:
            key = artifact_key(step, "progress")
            made = create_progress_artifact(percent, key=key, description=f"{step}: {what}")
            assert isinstance(made, UUID)  # outside of an event loop it is no coroutine
            self._of[step] = made

    def finished(self, made: Visit) -> None:
        """Fill the bar; a call that fails is logged."""
        if made.step.name in self._of:
            with failures_logged():
                update_progress_artifact(self._of[made.step.name], 100.0)


def publish_links(metrics: dict[str, Any]) -> None:
    """Leave the places of the report, the metrics and the run in MLflow with the flow run."""
    lines = [f"* {name}: `{place}`" for name, place in metrics["paths"].items() if isinstance(place, str)]
    if (logged := metrics["mlflow"])["url"]:
        lines.append(f"* run in MLflow: [{logged['run_id']}]({logged['url']})")
    if logged["waiting"]:
        lines.append(f"* not yet in MLflow: {logged['waiting']}")
    create_markdown_artifact(
        key=artifact_key("links"), markdown="\n".join(lines), description=f"Where {metrics['scene']} is"
    )


def _embedded(picture: Path) -> str:
    # The UI cannot read this machine's files, so the picture travels inside the text.
    return "data:image/jpeg;base64," + base64.b64encode(thumbnail_jpeg(picture)).decode()
