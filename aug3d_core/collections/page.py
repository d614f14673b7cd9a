"""The report of a collection's version: one page without network."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from aug3d_core.collections.made import TOWN, MadeCollection
from aug3d_core.judging.names import ends_of, interval_words
from aug3d_core.report.html import duration, number, page, picture, table, tag
from aug3d_core.store.store import Store

_ROLES = {"train": "trained on", "hold out": "never seen"}
_CHEAP = (
    ("ground_homography", "homography"),
    ("plane_sweep", "sweep without learning"),
    ("mesh_render", "mesh"),
    ("guided_blend", "blend over the mesh"),
)


def report(store: Store, metrics: Mapping[str, Any], made: MadeCollection) -> str:
    """Return the page."""
    training = metrics["training"]
    towns = sum(member.role == TOWN and bool(member.data) for member in made.members.values())
    facts = [
        f"{training['scenes']} data sets in training, {towns} of them made-up towns",
        f"{training['steps']:,} steps, {training['parameters']:,} parameters",
        f"training {duration(training['cpu_seconds'] or 0)} of processor time, {training['peak_mib']:.0f} MiB",
    ]
    parts = [tag("h1", f"Collection {metrics['collection']}"), tag("p", "; ".join(facts) + ".")]
    parts += [tag("p", escape(f"Note: {note}."), class_="note") for note in metrics["notes"]]
    parts += [tag("h2", "Held-out photographs, scene by scene"), _scores(metrics["tests"])]
    trouble = {name: one["trouble"] for name, one in metrics["scenes"].items() if "trouble" in one} | metrics[
        "untested"
    ]
    if trouble:
        rows = [[number(name), number(what)] for name, what in trouble.items()]
        parts += [tag("h2", "Not made, or not judged"), table(("scene", "why"), rows)]
    for name, record in made.evaluations.items():
        shown = [(caption, store.file(record, path)) for caption, path in list(record.pictures.items())[:1]]
        parts += [tag("h2", name), *(picture(path, caption) for caption, path in shown)]
    return page(f"Collection {metrics['collection']}", "".join(parts))


def _scores(tests: Mapping[str, Mapping[str, Any]]) -> str:
    heads = ["scene", "part", "views", "PSNR [dB]", "95 % interval", "SSIM", "FLIP", "from inputs alone [dB]"]
    heads += [f"over {words} [dB]" for _, words in _CHEAP]
    rows = []
    for name, told in tests.items():
        alone = told.get("inputs_alone_psnr_mean", told["test_psnr_mean"])
        rows.append(
            [
                number(name),
                _ROLES[told["role"]],
                number(told["test_views"]),
                f"{told['test_psnr_mean']:.2f}",
                interval_words(ends_of(told, "test_psnr")),
                f"{told['test_ssim_mean']:.3f}",
                f"{told['test_flip_mean']:.3f}",
                f"{alone:.2f}",
                *(
                    f"{told['test_psnr_mean'] - told[f'cheap_{cheap}']:+.2f}"
                    f"{interval_words(ends_of(told, f'over_{cheap}'))}"
                    for cheap, _ in _CHEAP
                ),
            ]
        )
    return table(heads, rows, numeric=range(2, len(heads)))


def write(store: Store, metrics: Mapping[str, Any], made: MadeCollection, path: Path) -> None:
    """Write the page."""
    path.write_text(report(store, metrics, made), encoding="utf-8")
