"""What runs, how far, how long still: a live table with a line for the whole run on a terminal, a line per stage elsewhere."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from aug3d_core.factory.plan import later_folds
from aug3d_core.run.stage import Stage
from flows.time_left import TimeLeft
from flows.words import figure, time_words

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit


class Display(AbstractContextManager):
    """A progress listener that shows every step of the run from the moment it is known, with its state."""

    def __init__(self, console: Console, stages: tuple[Stage, ...], expected_s: Mapping[str, float]) -> None:
        """Prepare a row per stage. expected_s: what the steps that are not there yet take, by name [s]."""
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
        )
        self._stages, self._expected_s = stages, dict(expected_s)
        self._left = TimeLeft(expected_s)
        self._live = Live(console=console, get_renderable=self._drawn, refresh_per_second=4)
        self._rows: dict[str, TaskID] = {}
        for stage in stages:
            self._add(stage.name)

    def __enter__(self) -> Display:
        """Begin to draw."""
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the last state on the screen."""
        if self._console.is_terminal:
            self._live.stop()

    def started(self, step: str) -> None:
        """Mark a step as running."""
        self._left.started(step, time.monotonic())
        self._bars.start_task(self._rows[step])
        self._bars.update(self._rows[step], mark="[cyan]>[/]")
        if not self._console.is_terminal:
            number = list(self._rows).index(step) + 1
            said = f"{time.strftime('%H:%M:%S')} [{number}/{len(self._rows)}] {step} ...{self._whole()}"
            self._console.print(said, markup=False)

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """Move a step's bar."""
        self._left.advanced(step, done / max(total, 1))
        self._bars.update(self._rows[step], completed=done, total=max(total, 1), what=what)

    def finished(self, made: Visit) -> None:
        """Mark a step as done, with its accuracy figure; the split tells which further folds there will be."""
        record, accuracy = made.record, made.step.stage.accuracy
        self._left.finished(made.step.name, time.monotonic(), cached=made.cached)
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
            self._left.add(step.name, self._expected_s.get(step.name, self._expected_s.get(step.stage.name, 0.0)))

    def _drawn(self) -> Group:
        return Group(self._bars, self._whole())

    def _whole(self) -> str:
        """Return what the whole run still takes; nothing where nobody could estimate it."""
        if not self._expected_s:
            return ""
        return f"  about {time_words(self._left.seconds(time.monotonic()))} left of the whole run"

    def _add(self, step: str) -> None:
        self._rows[step] = self._bars.add_task(step, start=False, total=1, mark=" ", what="")
