"""What fleets are made of: a task is one log, workers run tasks and tell how each ended."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from mcap_landmarks.locations import Location

CommandLine = Callable[[list[str]], None]
"""The toolkit's command line: it takes the words after `mcap-landmarks` and raises SystemExit with the exit code."""
Cut = Literal["killed", "time", "memory"]
"""What ended a task before its own end: somebody's signal, or a limit."""
Started = Callable[["Task", int], None]
"""Is told that a task starts, again for its second try, and the id of the process that works on it."""
Waits = Callable[["Task"], None]
"""Is told that a task was cut, and waits for its second try."""

TRIES = 2
"""A task that was cut gets one retry; what ends with an error of its own would end so again."""


@dataclass(frozen=True, slots=True)
class Task:
    """One log, where its result goes, and the words of the command line that make it, from the verb on.

    It can be pickled, and holds no payload: the worker reads the log from where it lies.
    """

    log: Location
    output: Location
    words: tuple[str, ...]

    @property
    def verb(self) -> str:
        """What is done."""
        return self.words[0]


@dataclass(frozen=True, slots=True)
class TaskLimits:
    """What one task may take; None: no limit. `memory_text` is the size as the user wrote it."""

    seconds: float | None = None
    memory_bytes: int | None = None
    memory_text: str | None = None


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended: its exit code, below zero the signal that killed it, and what it printed.

    `cut` says what ended it before its own end; `stderr` has it in words then, as `error: WHAT; REMEDY`.
    `peak_bytes` is the largest resident size of its process while it ran, None if it could not tell any more.
    """

    task: Task
    exit_code: int
    stdout: str
    stderr: str
    seconds: float
    peak_bytes: int | None
    attempts: int
    cut: Cut | None = None


class Workers(Protocol):
    """Run tasks, several at a time."""

    def run(self, tasks: Sequence[Task], limits: TaskLimits, started: Started, waits: Waits) -> Iterator[Ended]:
        """Run the tasks, each of which ends, whatever becomes of its worker; in the order in which they end.

        A task that was cut gets `TRIES`. Where the iteration is broken off, as by Ctrl-C, the running ones clean up
        and end, and no more start.
        """
