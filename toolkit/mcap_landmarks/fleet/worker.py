"""One task within this process: its verb's command line, what that prints, how long it takes, and how much memory."""

import contextlib
import contextvars
import os
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from mcap_landmarks.fleet.tasks import CommandLine, Cut, Ended, Task

_UNUSABLE = 1
INTERRUPTED = (130, 143)
"""Exit codes of the command line (`cli.console`): no usable output; and those of Ctrl-C and SIGTERM."""
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "VECLIB_MAXIMUM_THREADS"),
    "1",
)
_RESET_PEAK = b"5"
"""What resets the peak of the resident size when it is written to /proc/self/clear_refs (proc(5), Linux 4.0)."""


def use_one_thread() -> None:
    """Let numeric libraries use one thread in this process: workers are as many as cores. Before they are imported."""
    os.environ.update(_ONE_THREAD)


def run_task(task: Task, command_line: CommandLine, attempt: int = 1) -> Ended:
    """Run a task's words by the command line in this process, and tell how that ended; it never raises.

    What the task prints is caught at the level of file descriptors, where native libraries print, too. Context
    variables, the environment, filters of warnings and the working folder are for the next task as they were for this.
    """
    start = time.monotonic()
    can_tell = _reset_peak()
    with _caught() as printed, _as_before():
        code, cut = contextvars.copy_context().run(_exit_code, task, command_line)
    seconds = time.monotonic() - start
    return Ended(task, code, printed.stdout, printed.stderr, seconds, _peak(can_tell=can_tell), attempt, cut)


def _exit_code(task: Task, command_line: CommandLine) -> tuple[int, Cut | None]:
    sys.argv = ["mcap-landmarks", *task.words]  # what usage errors call the command
    try:
        command_line(list(task.words))
    except SystemExit as stop:
        if stop.code is None or isinstance(stop.code, int):
            return stop.code or 0, None
        sys.stderr.write(f"error: {stop.code}\n")
    except KeyboardInterrupt:
        return INTERRUPTED[0], None
    except MemoryError:
        sys.stderr.write(
            f"error: {task.log}: {task.verb} ran out of memory; use fewer --workers, or a machine with more memory\n"
        )
        return _UNUSABLE, "memory"
    except BaseException as error:  # noqa: BLE001 - one log must not end the others, whatever a library raises
        traceback.print_exc()
        what = " ".join(f"{type(error).__name__}: {error}".split())
        sys.stderr.write(f"error: {task.log}: {task.verb} failed unexpectedly ({what}); please report it\n")
    else:
        return 0, None
    return _UNUSABLE, None


@dataclass(slots=True)
class _Printed:
    stdout: str = ""
    stderr: str = ""


@contextlib.contextmanager
def _caught() -> Iterator[_Printed]:
    """What is printed in the block, by Python or below it, as soon as it has ended."""
    printed = _Printed()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        with (
            _redirected(1, out) as stdout,
            _redirected(2, err) as stderr,
            contextlib.redirect_stdout(stdout),
            contextlib.redirect_stderr(stderr),
        ):
            yield printed
        printed.stdout, printed.stderr = _text(out), _text(err)


@contextlib.contextmanager
def _redirected(descriptor: int, target: BinaryIO) -> Iterator[TextIO]:
    """A stream to a descriptor that leads to a file while the block runs."""
    own = os.dup(descriptor)
    try:
        os.dup2(target.fileno(), descriptor)
        with open(descriptor, "w", encoding="utf-8", errors="backslashreplace", closefd=False) as stream:
            yield stream
    finally:
        os.dup2(own, descriptor)
        os.close(own)


def _text(stream: BinaryIO) -> str:
    stream.seek(0)
    return stream.read().decode("utf-8", "replace")


@contextlib.contextmanager
def _as_before() -> Iterator[None]:
    """Put back what a block may change of this process: environment, arguments, folder, filters of warnings."""
    environment, arguments, folder = dict(os.environ), sys.argv, Path.cwd()
    try:
        with warnings.catch_warnings():
            yield
    finally:
        if dict(os.environ) != environment:
            os.environ.clear()
            os.environ.update(environment)
        sys.argv = arguments
        os.chdir(folder)


def _reset_peak() -> bool:
    """Let the peak of the resident size begin anew; False where the system cannot."""
    try:
        Path("/proc/self/clear_refs").write_bytes(_RESET_PEAK)
    except OSError:
        return False
    return True


def _peak(*, can_tell: bool) -> int:
    """The largest resident size in bytes since `_reset_peak`; where that cannot be, since the process began."""
    if can_tell:
        for line in Path("/proc/self/status").read_text().splitlines():
            name, _, value = line.partition(":")
            if name == "VmHWM":
                return int(value.split()[0]) << 10
    unit = 1 if sys.platform == "darwin" else 1 << 10  # getrusage(2) of each
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
