"""How much time the logs of a fleet span, by their own clocks."""

import contextlib
from collections.abc import Iterable
from pathlib import Path

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fleet.tasks import Task
from mcap_landmarks.recording.reader import open_recording

_SPANS = ("--start", "--end")


def recorded_s(tasks: Iterable[Task]) -> float:
    """The seconds of log time that the recordings of some tasks span.

    Logs of other formats and at URLs count as none, and so do those of which only a part is read: to look into them
    would take longer than the figure is worth.
    """
    total_ns = 0
    for task in tasks:
        if not isinstance(task.log, Path) or any(word.startswith(_SPANS) for word in task.words):
            continue
        with contextlib.suppress(ToolkitError, OSError), open_recording(task.log) as recording:
            if recording.start_ns is not None and recording.end_ns is not None:
                total_ns += recording.end_ns - recording.start_ns
    return total_ns / 1e9
