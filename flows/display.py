"""What runs, how far, how long still: a live table on a terminal, a line per stage elsewhere."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from aug3d_core.stage import Stage

if TYPE_CHECKING:
    from tasks.objects import Made


class Display(AbstractContextManager):
    """A progress listener that shows every stage of the run from the beginning, with its state."""

    def __init__(self, console: Console, stages: tuple[Stage, ...]) -> None:
        """Prepare a row per stage."""
        self._console = console
        self._bars = Progress(
            TextColumn("{task.fields[mark]} {task.description:<11}"),
            BarColumn(bar_width=24),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[what]}", markup=False),
            console=console,
            disable=not console.is_terminal,
        )
        self._rows: dict[str, TaskID] = {
            stage.name: self._bars.add_task(stage.name, start=False, total=1, mark=" ", what="") for stage in stages
        }
        self._count = len(stages)

    def __enter__(self) -> Display:
        """Begin to draw."""
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the last state on the screen."""
        self._bars.stop()

    def started(self, stage: str) -> None:
        """Mark a stage as running."""
        self._bars.start_task(self._rows[stage])
        self._bars.update(self._rows[stage], mark="[cyan]>[/]")
        if not self._console.is_terminal:
            number = list(self._rows).index(stage) + 1
            self._console.print(f"{time.strftime('%H:%M:%S')} [{number}/{self._count}] {stage} ...", markup=False)

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Move a stage's bar."""
        self._bars.update(self._rows[stage], completed=done, total=max(total, 1), what=what)

    def finished(self, made: Made) -> None:
        """Mark a stage as done, with its accuracy figure."""
        record = made.record
        said = f"{made.stage.accuracy} = {figure(record.metrics.get(made.stage.accuracy))}"
        mark = "[yellow]![/]" if record.state == "degraded" else "[green]✓[/]"
        row = self._rows[record.stage]
        self._bars.update(row, total=1, completed=1, mark=mark, what=("cached  " if made.cached else "") + said)
        self._bars.stop_task(row)
        if not self._console.is_terminal:
            cost = "cached" if made.cached else f"{record.seconds:.1f} s, {record.peak_mib:.0f} MiB"
            self._console.print(f"{time.strftime('%H:%M:%S')}        {record.stage}: {cost}, {said}", markup=False)


def figure(value: float | int | str | bool | None) -> str:
    """Return a metric as people write it."""
    return f"{value:.4g}" if isinstance(value, float) else "-" if value is None else str(value)
