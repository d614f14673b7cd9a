"""What a person finds in the Prefect UI: a table per stage, its pictures, and links."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from prefect.artifacts import create_markdown_artifact, create_table_artifact

from aug3d_core.charts.thumbnails import thumbnail_jpeg
from aug3d_core.store.store import Store

if TYPE_CHECKING:
    from tasks.objects import Made


def publish(store: Store, made: Made) -> None:
    """Leave a stage's figures and pictures with the flow run."""
    record = made.record
    rows = [
        {"what": "state", "value": record.state},
        {"what": "cached", "value": made.cached},
        {"what": "seconds", "value": record.seconds},
        {"what": "peak_mib", "value": record.peak_mib},
        {"what": "folder", "value": str(store.files_dir(record))},
        *({"what": name, "value": value} for name, value in record.metrics.items()),
    ]
    create_table_artifact(
        key=artifact_key(record.stage, "figures"), table=rows, description="\n\n".join(record.notes) or record.stage
    )
    if record.pictures:
        sections = [
            f"### {caption}\n\n![{caption}]({_embedded(store.files_dir(record) / path)})"
            for caption, path in record.pictures.items()
        ]
        create_markdown_artifact(key=artifact_key(record.stage, "pictures"), markdown="\n\n".join(sections))


def artifact_key(stage: str, what: str) -> str:
    """Return a key that Prefect takes: lower-case letters, digits and dashes, no underscore."""
    return f"{stage}-{what}".replace("_", "-")


def publish_links(metrics: dict[str, Any]) -> None:
    """Leave the places of the report, the metrics and the MLflow store with the flow run."""
    lines = [f"* {name}: `{place}`" for name, place in metrics["paths"].items() if isinstance(place, str)]
    create_markdown_artifact(key="links", markdown="\n".join(lines), description=f"Where {metrics['scene']} is")


def _embedded(picture: Path) -> str:
    # The UI cannot read this machine's files, so the picture travels inside the text.
    return "data:image/jpeg;base64," + base64.b64encode(thumbnail_jpeg(picture)).decode()
