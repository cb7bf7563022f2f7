"""The options of a batch itself, beside those of its verb: who works on it, how much a log may take, who is told."""

import os
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks import memory
from mcap_landmarks.cli.console import warn
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mcap_landmarks.fleet.tasks import Task, TaskLimits, Workers
    from mcap_landmarks.vision.config import ProviderChoice


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
    ray: Annotated[
        str | None,
        typer.Option(
            "--ray",
            metavar="ADDRESS",
            help="Work on a Ray cluster: auto, HOST:PORT or ray://HOST:PORT; local starts one here (extra cluster).",
        ),
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
        return TaskLimits(self.time_limit, memory.size(self.memory_limit, "--memory-limit"), self.memory_limit)

    def crew(self, tasks: "Sequence[Task]") -> "Workers":
        """The workers for some tasks.

        Raises:
            ToolkitError: Ray is asked for, and not installed.
        """
        from mcap_landmarks.cli.main import run

        if self.ray is None:
            from mcap_landmarks.fleet.local_workers import LocalWorkers

            return LocalWorkers(min(self.workers or len(os.sched_getaffinity(0)), len(tasks)), run)
        try:
            from mcap_landmarks.fleet.on_ray.ray_workers import RayWorkers
        except ModuleNotFoundError as error:
            raise ToolkitError(f"{error.name} is not installed: pip install 'mcap-landmarks[cluster]'") from error
        return RayWorkers(run, self.ray, self.workers, provider=provider_of(tasks[0].words), say=warn)


def provider_of(words: "Sequence[str]") -> "ProviderChoice":
    """What runs the network of a verb with these words."""
    from mcap_landmarks.config import gather, load
    from mcap_landmarks.vision.config import DetectConfig

    files, settings = _values(words, "--config"), _values(words, "--set")
    config = load("detect", gather(location(files[-1]) if files else None, settings, None))
    assert isinstance(config, DetectConfig)  # noqa: S101 - as its stage declares it
    return config.provider


def _values(words: "Sequence[str]", option: str) -> list[str]:
    """The values of an option among the words of a verb."""
    apart = [value for name, value in pairwise(words) if name == option]
    return apart or [word.partition("=")[2] for word in words if word.startswith(f"{option}=")]
