"""The catalogue of a batch: a row for each log that has ended, appended when the batch ends, or is broken off."""

import contextlib
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from mcap_landmarks.cli.batch_reports import Report
from mcap_landmarks.cli.console import warn
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.locations import Location, address

if TYPE_CHECKING:
    from mcap_landmarks.catalogue.catalogue_columns import Row
    from mcap_landmarks.fleet.tasks import Ended, Task


class BatchRows:
    """Makes a row of each task that ends; `is_lost` says whether the catalogue could not be written."""

    def __init__(self, place: Location | None, tasks: "Sequence[Task]") -> None:
        self._place = place
        self._positions = {task: position for position, task in enumerate(tasks)}
        self._started = datetime.now(UTC)
        self._rows: list[Row] = []
        self.is_lost = False

    def started(self, task: "Task", pid: int) -> None:
        """What starts has no row yet."""

    def waits(self, task: "Task") -> None:
        """See `cli.batch_run.Listener`: it is told when it starts again."""

    def ended(self, report: Report, ended: "Ended") -> None:
        """A task has ended."""
        if self._place is None:
            return
        from mcap_landmarks.catalogue.last_runs import kept_as
        from mcap_landmarks.fleet.catalogue_rows import Told, row_of

        told = Told(report["outcome"], report["result"], report["errors"], report["notes"])
        row = row_of(ended, told, self._positions[ended.task], self._started)
        row["log"] = kept_as(ended.task.log, self._place)
        if row["output"] is not None:
            row["output"] = kept_as(ended.task.output, self._place)
        self._rows.append(row)

    def add_map(self, database: Location, document: object) -> None:
        """The map of all logs that have not failed is there."""
        if self._place is None:
            return
        from mcap_landmarks.catalogue.last_runs import kept_as
        from mcap_landmarks.fleet.catalogue_rows import shared_by_logs

        shared = {**shared_by_logs(database, document), "output": kept_as(database, self._place)}
        for row in self._rows:
            if row["outcome"] != "failed":
                row.update(shared)

    def write(self) -> None:
        """Append the rows by log; where that cannot be it is said, as what the batch made is there all the same."""
        if self._place is None or not self._rows:
            return
        from mcap_landmarks.catalogue.catalogue_file import append_rows

        try:
            append_rows(self._place, sorted(self._rows, key=lambda row: (str(row["log"]), str(row["position"]))))
        except ToolkitError as error:
            self.is_lost = True
            warn(f"error: the catalogue: {error}")


@contextlib.contextmanager
def batch_rows(place: Location | None, tasks: "Sequence[Task]") -> Iterator[BatchRows]:
    """Rows for a catalogue, which are written when the block ends, however that is; none without a `place`.

    Raises:
        UsageError, RecordingError: no rows can be appended there, or it is a log or an output.
    """
    if place is not None:
        from mcap_landmarks.catalogue.catalogue_file import check_catalogue

        if address(place) in {address(file) for task in tasks for file in (task.log, task.output)}:
            raise UsageError(f"--catalogue {place}: is a log or an output; name another file")
        check_catalogue(place)
    rows = BatchRows(place, tasks)
    try:
        yield rows
    finally:
        rows.write()
