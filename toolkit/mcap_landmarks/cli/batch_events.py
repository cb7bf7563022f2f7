"""The events of a batch as JSON lines: what starts, is tried again and ends, with times and figures."""

import contextlib
import json
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from mcap_landmarks.cli.batch_reports import Report
from mcap_landmarks.errors import UsageError
from mcap_landmarks.fleet.tasks import Ended, Task
from mcap_landmarks.locations import Location

SCHEMA = "mcap-landmarks/batch_event/1"


class EventLines:
    """Writes a line for each event, at once."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self._tries: dict[Task, int] = {}

    def started(self, task: Task, pid: int) -> None:
        """A process works on a task from now on; `retried` if one did before."""
        attempt = self._tries[task] = self._tries.get(task, 0) + 1
        self._write("started" if attempt == 1 else "retried", task, {"worker": pid, "attempt": attempt})

    def waits(self, task: Task) -> None:
        """See `cli.batch_run.Listener`: it is told when it starts again."""

    def ended(self, report: Report, ended: Ended) -> None:
        """A task has ended."""
        names = ("outcome", "exit_code", "seconds", "peak_bytes", "attempts", "errors")
        figures = {name: value for name, value in report.items() if name in names}
        self._write("ended", ended.task, {**figures, "cut": ended.cut})

    def _write(self, event: str, task: Task, more: dict[str, object]) -> None:
        if self._stream is not None:
            now = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
            line = {"schema": SCHEMA, "event": event, "time": now, "log": str(task.log), "output": str(task.output)}
            self._stream.write(json.dumps({**line, **more}) + "\n")
            self._stream.flush()


@contextlib.contextmanager
def event_lines(place: Location | None) -> Iterator[EventLines]:
    """Lines at the end of a file, on stdout for `-`, or nowhere.

    Raises:
        UsageError: the file cannot be written.
    """
    if place is None:
        yield EventLines(None)
    elif str(place) == "-":
        yield EventLines(sys.stdout)
    elif not isinstance(place, Path):
        raise UsageError(f"{place}: events are added line by line; name a file of this machine")
    else:
        try:
            stream = place.open("a", encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{place}: cannot be written ({error.strerror}); name another file") from error
        with stream:
            yield EventLines(stream)
