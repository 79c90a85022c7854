"""What the runner shows while it works and when it is done."""

import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType

from rich import box
from rich.console import Console
from rich.live import Live
from rich.table import Table

VERDICTS = ("reproduced", "close", "differs", "calibrated", "not attempted")
HEARTBEAT_S = 20.0


@dataclass(frozen=True)
class Outcome:
    """How one notebook ended: ``done``, ``up to date``, ``failed`` or ``interrupted``."""

    slug: str
    status: str
    seconds: float = 0.0
    verdicts: dict[str, int] | None = None
    message: str = ""


@dataclass
class _Row:
    cells: int
    started: float
    cell: int = 0
    status: str = "running"
    ended: float | None = None
    spoken: float = 0.0

    @property
    def elapsed(self) -> float:
        return (self.ended or time.monotonic()) - self.started


class Display:
    """A live table in a terminal, plain lines everywhere else."""

    def __init__(self, console: Console | None = None) -> None:
        width = None if sys.stdout.isatty() else 120
        self.console = console or Console(width=width, highlight=False)
        self._rows: dict[str, _Row] = {}
        self._live = Live(
            get_renderable=self._progress, console=self.console, refresh_per_second=4, transient=True
        )

    def __enter__(self) -> "Display":
        if self.console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def say(self, line: str) -> None:
        """Print a line above the live table."""
        self.console.print(line, markup=False, soft_wrap=True)

    def started(self, slug: str, cells: int, reason: str) -> None:
        """Show that a notebook has started, and why it has to run."""
        self._rows[slug] = _Row(cells, time.monotonic())
        self.say(f"{slug}: running, {cells} code cells ({reason})")

    def cell(self, slug: str, number: int) -> None:
        """Show which code cell a notebook has come to."""
        self._rows[slug].cell = number

    def beat(self) -> None:
        """Without a terminal: say now and then how far the notebooks are."""
        if self.console.is_terminal:
            return
        for slug, row in list(self._rows.items()):
            if row.ended is None and row.elapsed - row.spoken > HEARTBEAT_S:
                row.spoken = row.elapsed
                self.say(f"{slug}: cell {row.cell}/{row.cells}, {row.elapsed:.0f} s")

    def finished(self, outcome: Outcome) -> None:
        """Show how a notebook ended."""
        row = self._rows.get(outcome.slug)
        if row:
            row.status, row.ended = outcome.status, time.monotonic()
            self.say(f"{outcome.slug}: {outcome.status} after {row.elapsed:.1f} s")

    def close(self, outcomes: Iterable[Outcome]) -> None:
        """Print the table of durations and verdicts, then what went wrong."""
        table = Table(box=box.SIMPLE_HEAD)
        table.add_column("notebook", no_wrap=True)
        table.add_column("status", no_wrap=True)
        for heading in ("seconds", *VERDICTS):
            table.add_column(heading, justify="right")
        for outcome in (outcomes := list(outcomes)):
            verdicts = outcome.verdicts or {}
            counts = [str(verdicts[verdict]) if verdicts.get(verdict) else "" for verdict in VERDICTS]
            seconds = f"{outcome.seconds:.1f}" if outcome.seconds else ""
            table.add_row(outcome.slug, outcome.status, seconds, *counts)
        self.console.print(table)
        for outcome in outcomes:
            if outcome.message:
                self.say(f"{outcome.slug}: {outcome.message}")

    def _progress(self) -> Table:
        table = Table("notebook", "cell", "elapsed", "", box=box.SIMPLE_HEAD)
        for slug, row in list(self._rows.items()):
            table.add_row(slug, f"{row.cell}/{row.cells}", f"{row.elapsed:.0f} s", row.status)
        return table
