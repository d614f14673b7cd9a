"""The study as a publication: one table, and time against accuracy for each scene."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from aug3d_core.heads.config import title_of
from aug3d_core.judging.names import called
from aug3d_core.report.html import duration, picture, table
from aug3d_core.report.story import GAINS
from aug3d_core.studies.common.page import notes
from aug3d_core.studies.common.publication import Publication, logged
from aug3d_core.studies.generalisation.findings import CHEAP, GeneralisationFindings, Row, order, score_table

QUESTION = "How good is a model on a place that it never saw?"
HEADS = (
    "scene",
    "way",
    "head",
    "views",
    "PSNR [dB]",
    "inputs alone [dB]",
    "SSIM",
    "FLIP",
    "training [CPU]",
    "foreseen [dB]",
)
_METHOD = (
    "Each scene of the collection is left out in turn. never seen: trained on all other scenes and the towns. tuned: that"
    " model, trained on the scene for a tenth of the steps of a model alone. alone: trained on the scene from random weights,"
    " four times as long as the others if these start from trained ones. All are judged on the scene's own test photographs,"
    " in every fold of a small scene, from the same inputs. Leads are paired over photographs and seeds, with 95 % intervals:"
    " over the homography and the sweep without learning from the inputs alone, over the mesh and the blend at its depth about"
    " the scaffold. The time of a tuned model is that of its tuning."
    " foreseen: before any prediction the preview predicts photographs from the others, with a model that never saw the scene;"
    " its lead over the better of homography and sweep. It warns where that lead may be none. A model that is then no better"
    " on the test, without a warning, is a silent failure."
)
_MARKS = {"never seen": "o", "tuned": "^", "alone": "s"}


def publication(found: GeneralisationFindings) -> Publication:
    """Return what the study publishes."""
    seconds = sum(result.cpu_seconds for result in found.results)
    return Publication(
        place=f"collection-{found.collection}",
        label="generalisation",
        title="Generalisation",
        question=QUESTION,
        about=f"generalisation, {found.collection}",
        data=found.as_json(),
        table=score_table(found),
        draw=partial(draw, found),
        facts={"collection": found.collection, "seeds": str(found.seeds), "runs": str(len(found.results))},
        chapters=lambda chart: {GAINS: _tables(found) + picture(chart, "Processor time of training against PSNR")},
        after=notes(
            [
                *((result.cell.name, result.failure) for result in found.failed),
                *((f"{row.scene}, {title_of(row.head)}", "silent failure") for row in found.silent),
            ]
        ),
        method=_METHOD,
        cost=f"{duration(seconds)} of processor time for training, on {found.machine}.",
        tags={"study": "generalisation"},
        params={"seeds": found.seeds, "collection": found.collection},
        metrics={f"{row.scene}.{row.way}.{row.head}.psnr": row.psnr for row in found.rows},
        cells=[logged(r, {"scene": r.arm.scene, "way": r.arm.way, "head": r.arm.head}) for r in found.results],
    )


def cells(row: Row) -> list[str]:
    """Return a row of the table as text."""
    figures = [f"{row.psnr:.2f}", f"{row.alone_psnr:.2f}", f"{row.ssim:.3f}", f"{row.flip:.3f}"]
    foreseen = "" if row.foreseen_db is None else f"{row.foreseen_db:+.2f}{' (warned)' if row.warned else ''}"
    return [row.scene, row.way, title_of(row.head), str(row.views), *figures, duration(row.cpu_seconds), foreseen]


def over(row: Row) -> list[str]:
    """Return the leads over the cheap answers as text."""
    return [row.over[cheap].text() for cheap in CHEAP]


def _tables(found: GeneralisationFindings) -> str:
    rows = sorted(found.rows, key=order)
    heads = [*HEADS, *(f"over {called(cheap)} [dB]" for cheap in CHEAP)]
    scores = table(heads, [[*cells(row), *over(row)] for row in rows], numeric=range(3, len(heads)))
    against = [[name, lead.text()] for name, lead in found.against.items()]
    return scores + (table(("paired", "difference [dB]"), against, numeric=(1,)) if against else "")


def draw(found: GeneralisationFindings, path: Path) -> None:
    """Draw processor time of training against PSNR, a panel for each scene; empty marks are from the inputs alone."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    scenes: Sequence[str] = list(dict.fromkeys(row.scene for row in found.rows)) or ["none"]
    heads = list(dict.fromkeys(row.head for row in found.rows))
    figure = Figure(figsize=(4.2 * len(scenes), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    marks = {}
    for axes, scene in zip(figure.subplots(1, len(scenes), squeeze=False)[0], scenes, strict=True):
        for row in (row for row in found.rows if row.scene == scene):
            colour, minutes = f"C{heads.index(row.head)}", max(row.cpu_seconds / 60, 0.01)
            look = {"marker": _MARKS[row.way], "linestyle": "none", "color": colour}
            name = f"{row.way}, {title_of(row.head)}"
            marks[name] = axes.plot(minutes, row.psnr, **look)[0]
            axes.plot(minutes, row.alone_psnr, **look, markerfacecolor="none")
        axes.set_title(scene)
        axes.set_xlabel("training [processor min]")
        axes.set_ylabel("PSNR [dB]; empty: from the inputs alone")
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.margins(0.15)
    if marks:
        figure.legend(marks.values(), marks.keys(), loc="outside lower center", ncols=2, fontsize=8)
    figure.savefig(path, dpi=120)
