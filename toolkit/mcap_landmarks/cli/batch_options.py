"""The options of a batch itself, beside those of its verb: who works on it, how much a log may take, who is told."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks import memory
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.fleet.tasks import TaskLimits, Workers


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """What `batch` takes whatever the verb is."""

    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Logs at a time; as many as cores by default.")
    ] = None
    time_limit: Annotated[
        float | None, typer.Option("--time-limit", metavar="SECONDS", help="End a log that takes longer.")
    ] = None
    memory_limit: Annotated[
        str | None,
        typer.Option("--memory-limit", metavar="SIZE", help="End a log whose process grows larger, such as 4G."),
    ] = None
    events: Annotated[
        Location | None,
        typer.Option(
            "--events", parser=location, help="Add a JSON line to this file for each start, retry and end; - prints it."
        ),
    ] = None

    catalogue: Annotated[
        Location | None,
        typer.Option(
            "--catalogue",
            parser=location,
            metavar="FILE",
            help="Add a row per log to this table: runs.parquet, or runs.db (SQLite) where pyarrow is not installed.",
        ),
    ] = None

    @property
    def prints_events(self) -> bool:
        """Whether stdout is for the events."""
        return self.events is not None and str(self.events) == "-"

    def limits(self) -> "TaskLimits":
        """What one log may take.

        Raises:
            UsageError: a limit is none.
        """
        from mcap_landmarks.fleet.tasks import TaskLimits

        if self.time_limit is not None and not 0 < self.time_limit < float("inf"):
            raise UsageError(f"--time-limit {self.time_limit}: give seconds, more than none")
        return TaskLimits(self.time_limit, memory.size(self.memory_limit, "--memory-limit"))

    def crew(self, tasks: int) -> "Workers":
        """The workers for so many tasks."""
        from mcap_landmarks.cli.main import run
        from mcap_landmarks.fleet.local_workers import LocalWorkers

        return LocalWorkers(min(self.workers or len(os.sched_getaffinity(0)), tasks), run)
