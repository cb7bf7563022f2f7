"""A batch under way: tasks are run, and whoever listens is told what starts and what became of each."""

from collections.abc import Sequence
from typing import Protocol

from mcap_landmarks.cli.batch_reports import Report, report_of, stamp
from mcap_landmarks.cli.console import warn
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits, Workers
from mcap_landmarks.wording import counted


class Listener(Protocol):
    """What follows a batch: the table, the lines of events, the catalogue."""

    def started(self, task: Task, pid: int) -> None:
        """A process works on a task from now on, for the second time if it was started before."""

    def waits(self, task: Task) -> None:
        """A task was cut, and waits for its second try."""

    def ended(self, report: Report, ended: Ended) -> None:
        """A task has ended and will not be tried again."""


def run_batch(
    verb: str, tasks: Sequence[Task], workers: Workers, limits: TaskLimits, listeners: Sequence[Listener]
) -> list[Report]:
    """What became of each task, in their order. On Ctrl-C and SIGTERM it is said how many are finished."""
    places = {task: place for place, task in enumerate(tasks)}
    before = {task: stamp(task.output) for task in tasks}
    reports: dict[int, Report] = {}

    def started(task: Task, pid: int) -> None:
        for listener in listeners:
            listener.started(task, pid)

    def waits(task: Task) -> None:
        for listener in listeners:
            listener.waits(task)

    try:
        for ended in workers.run(tasks, limits, started, waits):
            report = reports[places[ended.task]] = report_of(verb, ended, before[ended.task])
            for listener in listeners:
                listener.ended(report, ended)
    except (KeyboardInterrupt, SystemExit):
        good = sum(report["outcome"] != "failed" for report in reports.values())
        warn(f"{good} of {counted(len(tasks), 'log')} are finished; the same command goes on with the others")
        raise
    return [reports[place] for place in sorted(reports)]
