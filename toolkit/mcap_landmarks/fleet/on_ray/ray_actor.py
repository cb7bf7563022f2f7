"""One process of a Ray cluster: it works on a log at a time, keeps the network's session, and heeds the limits."""

import contextlib
import ctypes
import os
import platform
import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import ray

from mcap_landmarks import __version__
from mcap_landmarks.fleet.cuts import over_memory, over_time
from mcap_landmarks.fleet.tasks import CommandLine, Ended, Task, TaskLimits
from mcap_landmarks.fleet.worker import run_task, use_one_thread
from mcap_landmarks.manifest import code_hash

_LOOK_S = 0.1
"""How often a task is held against its limits: in that time a process fills some 100 MB (1 GB/s)."""
LAST_WORDS_S = 10.0
"""How long an interrupted task may clean up, as long as `docker stop` waits."""
_USAGE_OR_FAILURE = (1, 2)
"""Exit codes of the command line (`cli.console`) where nothing was made."""


@dataclass(frozen=True, slots=True)
class Greeting:
    """Where an actor lives, and what it runs: `code` is the hash of the toolkit's sources there.

    `life` is another word for each process: Ray may put a new one into the place of an actor's at any time.
    """

    life: str
    node: str
    pid: int
    version: str
    code: str


class FleetActor:
    """Works on one task after the other; Ray calls `stop` on another thread than `run`.

    `folder` is where the batch was started: relative paths are meant from there.
    """

    def __init__(self, command_line: CommandLine, folder: Path) -> None:
        use_one_thread()
        self._command_line, self._folder = command_line, folder
        self._node, self._life = platform.node(), uuid.uuid4().hex
        self._sees_folder = True
        try:
            os.chdir(folder)
        except OSError:
            self._sees_folder = False
        self._working: threading.Thread | None = None

    @ray.method(max_task_retries=-1)
    def greet(self) -> Greeting:
        """Who this is."""
        return Greeting(self._life, self._node, os.getpid(), __version__, code_hash())

    def run(self, task: Task, limits: TaskLimits, attempt: int) -> Ended:
        """Work on a task. Where that is beyond its limits it may clean up; what it does not heed, goes on until this
        process is killed.
        """
        unseen = [path for path in (task.log, self._target(task)) if isinstance(path, Path) and not self._sees(path)]
        if unseen:
            remedy = "put it on a file system that all nodes have at the same path, or give a URL"
            return Ended(task, 2, "", f"error: {unseen[0]}: node {self._node} has no such file; {remedy}\n", 0, None, 1)
        ended: list[Ended] = []
        work = threading.Thread(target=lambda: ended.append(run_task(task, self._command_line, attempt)), daemon=True)
        self._working, began, peak = work, time.monotonic(), 0
        work.start()
        while work.is_alive():
            work.join(_LOOK_S)
            seconds, peak = time.monotonic() - began, max(peak, _resident_bytes())
            over = _over(limits, seconds, peak)
            if over is not None and work.is_alive():
                self.stop()
                work.join(LAST_WORDS_S)
                return over(task, limits, seconds, peak, attempt)
        return self._with_hint(ended[0])

    def stop(self) -> None:
        """Have the task end as Ctrl-C ends it: what is half written is removed."""
        if self._working is not None and self._working.is_alive():
            thread = ctypes.c_ulong(self._working.ident or 0)
            ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(KeyboardInterrupt))

    def _sees(self, path: Path) -> bool:
        return (self._folder / path).exists()

    @staticmethod
    def _target(task: Task) -> object:
        """The folder of a task's output, if it is on this machine."""
        return task.output.parent if isinstance(task.output, Path) else None

    def _with_hint(self, ended: Ended) -> Ended:
        if self._sees_folder or ended.exit_code not in _USAGE_OR_FAILURE:
            return ended
        where = f"node {self._node} has no folder {self._folder}, where the batch was started"
        return replace(ended, stderr=f"{ended.stderr}note: {where}; relative paths mean nothing there\n")


def _over(limits: TaskLimits, seconds: float, size_bytes: int) -> Callable[..., Ended] | None:
    """What a task is beyond."""
    if limits.seconds is not None and seconds > limits.seconds:
        return over_time
    if limits.memory_bytes is not None and size_bytes > limits.memory_bytes:
        return over_memory
    return None


def _resident_bytes() -> int:
    """The resident size of this process; 0 where the system does not tell (proc(5))."""
    with contextlib.suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0
