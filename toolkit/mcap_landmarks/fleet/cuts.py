"""Tasks that did not come to an end of their own, in words: limits, signals, and what to do about them."""

import contextlib
import signal

from mcap_landmarks.atomic import held
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fleet.tasks import Cut, Ended, Task, TaskLimits
from mcap_landmarks.memory import shown

_SIGNALLED = 128
"""An exit code above this tells the signal that made a process exit, as shells tell it."""


def over_time(task: Task, limits: TaskLimits, seconds: float, peak_bytes: int | None, attempt: int) -> Ended:
    """The end of a task that took longer than it may."""
    what = f"was ended after its --time-limit of {limits.seconds:g} s; give it more, or leave this log out"
    return _cut("time", task, -signal.SIGKILL, what, seconds, peak_bytes, attempt)


def over_memory(task: Task, limits: TaskLimits, seconds: float, peak_bytes: int | None, attempt: int) -> Ended:
    """The end of a task that took more memory than it may."""
    most, limit = shown(peak_bytes or 0), limits.memory_text or shown(limits.memory_bytes or 0)
    what = f"took {most}, more than its --memory-limit of {limit}; give it more, or leave this log out"
    return _cut("memory", task, -signal.SIGKILL, what, seconds, peak_bytes, attempt)


def was_killed(task: Task, exit_code: int | None, seconds: float, peak_bytes: int | None, attempt: int) -> Ended:
    """The end of a task whose process ended under it; the code is None where nobody knows it."""
    code = -signal.SIGKILL if exit_code is None else exit_code
    if code > _SIGNALLED:
        code = _SIGNALLED - code
    how = f"was killed by signal {-code}" if code < 0 else f"lost its process, which exited with {code}"
    what = f"{how}; if nobody did that, the machine lacks memory for so many --workers"
    return _cut("killed", task, code, what, seconds, peak_bytes, attempt)


def clear(task: Task) -> None:
    """Remove what a task left half written that cannot do so itself any more."""
    with contextlib.suppress(ToolkitError), held(task.output):
        pass


def _cut(
    cut: Cut, task: Task, exit_code: int, what: str, seconds: float, peak_bytes: int | None, attempt: int
) -> Ended:
    error = f"error: {task.log}: {task.verb} {what}\n"
    return Ended(task, exit_code, "", error, seconds, peak_bytes, attempt, cut)
