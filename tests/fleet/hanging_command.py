"""The toolkit's command line, but for logs that are named to hang, and workers with a limit for those alone: how long
the others take is the machine's.
"""

import time
from collections.abc import Iterator, Sequence

from mcap_landmarks.cli.main import run
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Ended, Started, Task, TaskLimits, Waits


def run_or_hang(words: list[str]) -> None:
    """Run a verb, or wait for ever where its log's name says so."""
    if _hangs(words):
        time.sleep(3600)
    run(words)


class HangingWorkers:
    """Two processes for what does not hang, then for what does."""

    def run(self, tasks: Sequence[Task], limits: TaskLimits, started: Started, waits: Waits) -> Iterator[Ended]:
        """See `fleet.tasks.Workers`."""
        workers = LocalWorkers(2, run_or_hang)
        yield from workers.run([task for task in tasks if not _hangs(task.words)], TaskLimits(), started, waits)
        yield from workers.run([task for task in tasks if _hangs(task.words)], limits, started, waits)


def _hangs(words: Sequence[str]) -> bool:
    return "hangs" in words[1]
