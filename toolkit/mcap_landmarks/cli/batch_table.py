"""The table of a running batch on a terminal; elsewhere a line for each log that has ended."""

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from mcap_landmarks.cli.batch_reports import OUTCOMES, BatchOutcome, Report
from mcap_landmarks.cli.console import harmless, say, warn
from mcap_landmarks.fleet.tasks import Ended, Task

if TYPE_CHECKING:
    from rich.table import Table

_PER_SECOND = 4
"""How often the table is drawn: often enough for its seconds to run."""

_STATES = ("waits to run again", "runs", "runs again")
"""By the number of a log's try, 0 where it waits for its second one."""


class LiveTable:
    """Which logs run, how many ended how, how fast, and the time that is left."""

    def __init__(self, verb: str, total: int, *, draws: bool) -> None:
        self._verb, self._total, self._draws = verb, total, draws
        self._began = time.monotonic()
        self._running: dict[Task, tuple[float, int]] = {}
        self._tries: dict[Task, int] = {}
        self._counts: dict[BatchOutcome, int] = dict.fromkeys(OUTCOMES, 0)

    def started(self, task: Task, pid: int) -> None:  # noqa: ARG002 # the table has no use for it
        """A process works on a task from now on."""
        attempt = self._tries[task] = self._tries.get(task, 0) + 1
        self._running[task] = time.monotonic(), attempt

    def waits(self, task: Task) -> None:
        """A task was cut, and waits for its second try: it is shown as such from now on."""
        self._running[task] = time.monotonic(), 0

    def ended(self, report: Report, ended: Ended) -> None:
        """A task has ended; without a terminal that is said in a line."""
        self._running.pop(ended.task, None)
        self._counts[report["outcome"]] += 1
        if not self._draws:
            warn(f"{report['log']}: {report['outcome']} ({report['seconds']:.1f} s)")

    def rows(self) -> list[tuple[str, str, str]]:
        """What is shown: a row per running log, then the totals."""
        now = time.monotonic()
        shown = [
            (str(task.log), _STATES[attempt], _clock(now - since))
            for task, (since, attempt) in list(self._running.items())
        ]
        ended, elapsed = sum(self._counts.values()), now - self._began
        counts = ", ".join(f"{count} {name}" for name, count in self._counts.items() if count) or "none ended"
        left = f"{_clock(elapsed / ended * (self._total - ended))} left" if ended else ""
        rate = f"{60 * ended / elapsed:.1f} logs/min" if ended else ""
        return [*shown, (f"{self._verb}: {ended} of {self._total} logs, {counts}", rate, left)]

    def __rich__(self) -> "Table":
        """The table for rich, which asks for it whenever it draws."""
        from rich.table import Table
        from rich.text import Text

        table = Table.grid(padding=(0, 2))
        for row in self.rows():
            table.add_row(*(Text(harmless(cell)) for cell in row))
        return table


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def say_pace(lasts_s: float, took_s: float) -> None:
    """How long the recordings last that were worked on, and how fast that went; nothing where it cannot be told."""
    if lasts_s > 0:
        say(f"{_clock(lasts_s)} of recording in {_clock(took_s)}: {lasts_s / took_s:.1f} times as fast as it lasts")


@contextlib.contextmanager
def live_table(verb: str, total: int) -> Iterator[LiveTable]:
    """A table on stderr while the block runs, if stderr is a terminal."""
    if not sys.stderr.isatty():
        yield LiveTable(verb, total, draws=False)
        return
    from rich.console import Console
    from rich.live import Live

    table = LiveTable(verb, total, draws=True)
    with Live(table, console=Console(stderr=True), refresh_per_second=_PER_SECOND, transient=True):
        yield table
