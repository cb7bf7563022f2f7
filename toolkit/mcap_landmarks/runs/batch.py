"""Many logs, one process each: a log that fails, or a process that is killed, takes no other with it."""

import contextlib
import glob
import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.inspection.open_logs import open_logs
from mcap_landmarks.locations import Location, location, same_place, to_read

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "VECLIB_MAXIMUM_THREADS"),
    "1",
)
_LAST_WORDS_S = 10.0
"""How long an interrupted process may clean up, as long as `docker stop` waits."""


@dataclass(frozen=True, slots=True)
class ProcessTask:
    """One log, where its result goes, and the command that makes it."""

    log: Path
    output: Location
    command: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ProcessEnd:
    """How a task's process ended: its exit code, below zero the signal that killed it, and what it printed."""

    task: ProcessTask
    exit_code: int
    stdout: str
    stderr: str


def find_logs(patterns: Sequence[str]) -> list[Path]:
    """The paths that the patterns (`**` is any depth) name, each once: by pattern, then by name.

    Raises:
        UsageError: a pattern is a URL, or matches nothing.
    """
    found: dict[Path, None] = {}
    for pattern in patterns:
        path = to_read(location(pattern))
        # Path.glob takes no absolute pattern.
        matches = [pattern] if path.exists() else sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207
        if not matches:
            raise UsageError(f"{pattern}: no file matches; quote the pattern and check the folder")
        found.update(dict.fromkeys(map(Path, matches)))
    return list(found)


def outputs_in(folder: Location, logs: Sequence[Path], suffix: str) -> dict[Path, Location]:
    """Output by log: the log's name with `suffix` in the folder. Earlier outputs there are no logs and are left out.

    A bag or data set that holds several logs, as one per robot, gets a folder of its own, without suffix.

    Raises:
        UsageError: two logs would write the same file, no log is left, or a target cannot be written.
    """
    outputs: dict[Path, Location] = {}
    taken: dict[Location, Path] = {}
    for log in logs:
        if log.suffix == suffix and same_place(log.resolve().parent, folder):
            continue
        name = log.name if log.is_dir() else log.stem
        target = folder / (name if _holds_several(log) else f"{name}{suffix}")
        if target in taken:
            raise UsageError(f"{log}: {taken[target]} also writes {target}; rename one, or run them apart")
        if not isinstance(target, Path) or not target.is_dir():
            check_target(target)
        outputs[log], taken[target] = target, log
    if not outputs:
        raise UsageError(f"{folder}: all logs lie in the output folder; name another one with -o")
    return outputs


def _holds_several(path: Path) -> bool:
    if path.suffix == ".mcap":
        return False
    try:
        with open_logs(path, {}) as logs:
            return len(logs) > 1
    except ToolkitError:
        return False  # its own process says what is wrong with it


def run_tasks(tasks: Sequence[ProcessTask], workers: int, progress: Callable[[int], None]) -> list[ProcessEnd]:
    """Run the tasks, so many at a time, and tell how each ended, in their order; `progress` gets 1 for each.

    Numeric libraries use one thread per process. On Ctrl-C or SIGTERM the running ones get the same and are waited for.
    The input of all is a pipe that ends with this process, however that ends; `mcap_landmarks.batched` heeds it.
    """
    with _pipe() as input_, ThreadPoolExecutor(workers) as pool:
        processes = _Processes(input_)
        futures = [pool.submit(processes.run, task) for task in tasks]
        try:
            for future in as_completed(futures):
                future.result()
                progress(1)
        except (KeyboardInterrupt, SystemExit) as stop:
            pool.shutdown(wait=False, cancel_futures=True)
            processes.interrupt(signal.SIGINT if isinstance(stop, KeyboardInterrupt) else signal.SIGTERM)
            raise
    return [future.result() for future in futures]


@contextlib.contextmanager
def _pipe() -> Iterator[int]:
    """The end to read of a pipe that nothing is written to, and whose other end no other process has."""
    reading, writing = os.pipe()
    try:
        yield reading
    finally:
        os.close(reading)
        os.close(writing)


class _Processes:
    """The processes that run at the moment."""

    def __init__(self, input_: int) -> None:
        self._input = input_
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._stopped = False

    def run(self, task: ProcessTask) -> ProcessEnd:
        """Start a task's process and wait for its end; nothing is started once they were interrupted."""
        with self._lock:
            if self._stopped:
                return ProcessEnd(task, -signal.SIGINT, "", "")
            process = subprocess.Popen(
                task.command,
                stdin=self._input,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                env={**os.environ, **_ONE_THREAD, "PYTHONIOENCODING": "utf-8"},
                process_group=0,  # the terminal's Ctrl-C comes to us alone, and `interrupt` hands it on once
            )
            self._running.add(process)
        stdout, stderr = process.communicate()
        with self._lock:
            self._running.discard(process)
        return ProcessEnd(task, process.returncode, stdout, stderr)

    def interrupt(self, how: signal.Signals) -> None:
        """Let each process clean up and end; one that does not is killed."""
        with self._lock:
            self._stopped = True
            running = list(self._running)
        for process in running:
            process.send_signal(how)
        for process in running:
            try:
                process.wait(_LAST_WORDS_S)
            except subprocess.TimeoutExpired:
                process.kill()
