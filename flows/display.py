"""What runs, how far, how long still: a live table on a terminal, a line per stage elsewhere."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from aug3d_core.factory.plan import later_folds
from aug3d_core.run.stage import Stage

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit


class Display(AbstractContextManager):
    """A progress listener that shows every step of the run from the moment it is known, with its state."""

    def __init__(self, console: Console, stages: tuple[Stage, ...]) -> None:
        """Prepare a row per stage."""
        self._console = console
        self._bars = Progress(
            TextColumn("{task.fields[mark]} {task.description:<16}"),
            BarColumn(bar_width=24),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[what]}", markup=False),
            console=console,
            disable=not console.is_terminal,
        )
        self._stages = stages
        self._rows: dict[str, TaskID] = {}
        for stage in stages:
            self._add(stage.name)

    def __enter__(self) -> Display:
        """Begin to draw."""
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the last state on the screen."""
        self._bars.stop()

    def started(self, step: str) -> None:
        """Mark a step as running."""
        self._bars.start_task(self._rows[step])
        self._bars.update(self._rows[step], mark="[cyan]>[/]")
        if not self._console.is_terminal:
            number = list(self._rows).index(step) + 1
            self._console.print(f"{time.strftime('%H:%M:%S')} [{number}/{len(self._rows)}] {step} ...", markup=False)

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """Move a step's bar."""
        self._bars.update(self._rows[step], completed=done, total=max(total, 1), what=what)

    def finished(self, made: Visit) -> None:
        """Mark a step as done, with its accuracy figure; the split tells which further folds there will be."""
        record, accuracy = made.record, made.step.stage.accuracy
        said = f"{accuracy} = {figure(record.metrics.get(accuracy))}"
        mark = "[yellow]![/]" if record.state == "degraded" else "[green]✓[/]"
        row = self._rows[made.step.name]
        self._bars.update(row, total=1, completed=1, mark=mark, what=("cached  " if made.cached else "") + said)
        self._bars.stop_task(row)
        if not self._console.is_terminal:
            cost = "cached" if made.cached else f"{record.seconds:.1f} s, {record.peak_mib:.0f} MiB"
            self._console.print(f"{time.strftime('%H:%M:%S')}        {made.step.name}: {cost}, {said}", markup=False)
        for step in later_folds(self._stages, {made.step.name: record}):
            self._add(step.name)

    def _add(self, step: str) -> None:
        self._rows[step] = self._bars.add_task(step, start=False, total=1, mark=" ", what="")


def figure(value: float | int | str | bool | None) -> str:
    """Return a metric as people write it."""
    return f"{value:.4g}" if isinstance(value, float) else "-" if value is None else str(value)
