"""Segments of one long log over the workers of a fleet: each is a task."""

from collections.abc import Iterator, Sequence
from functools import partial

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits, Workers
from mcap_landmarks.locations import Location
from mcap_landmarks.recording.reader import reads_from_front
from mcap_landmarks.runs.segment_tasks import Segments, SegmentTask

_ERROR = "error: "
"""How the command line begins the line that says why it failed."""


def segments_over(workers: Workers, seconds: float) -> Segments:
    """A log cut at multiples of some seconds, over workers.

    Raises:
        UsageError: the length is not above zero.
    """
    if not 0 < seconds < float("inf"):
        raise UsageError(f"--segments {seconds:g}: give seconds of log time, above 0, such as 60")
    return Segments(max(round(seconds * 1e9), 1), partial(_run, workers))


def _run(workers: Workers, segments: Sequence[SegmentTask]) -> Iterator[SegmentTask]:
    """Have the workers make segments; the first that fails ends it.

    Raises:
        RecordingError: one could not be made.
    """
    lenient = ("--lenient",) if reads_from_front() else ()
    by_target: dict[Location, SegmentTask] = {segment.target: segment for segment in segments}
    tasks = [
        Task(one.log, one.target, ("detect", str(one.log), "-o", str(one.target), "--segment", one.text, *lenient))
        for one in segments
    ]
    for ended in workers.run(tasks, TaskLimits(), lambda _task, _pid: None, lambda _task: None):
        if ended.exit_code:
            raise RecordingError(_why(ended))
        yield by_target[ended.task.output]


def _why(ended: Ended) -> str:
    """Why a task failed, in its own words."""
    errors = [line.removeprefix(_ERROR) for line in ended.stderr.splitlines() if line.startswith(_ERROR)]
    return errors[-1] if errors else f"{ended.task.log}: a segment ended with {ended.exit_code}; run the command again"
