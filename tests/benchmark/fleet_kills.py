"""Workers killed during a batch: `python -m tests.benchmark.fleet_kills [--json] [--quick]`.

20 logs are localized by two workers, undisturbed and with a `kill -9` of ten workers that are at work, at random
moments, no log's twice: it has one retry. Every log must end done, with the same bytes; on this machine and on Ray.
"""

import contextlib
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from mcap_landmarks.cli.main import run as command_line
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.on_ray.ray_workers import RayWorkers
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits, Workers
from mcap_landmarks.fleet.worker import run_task

from tests.benchmark.rows import Row, main
from tests.cli.logs import messages, write
from tests.fleet.clusters import cluster

_RNG_SEED = 12
_LOGS, _WORKERS = 20, 2
_PAUSE_S = (1.0, 5.0)
"""Between two kills: a worker is back after 2 to 8 s, a log takes about 1 s."""


class Killer:
    """Kills so many workers that are at work while the block runs."""

    def __init__(self, most: int) -> None:
        self._rng, self._most = np.random.default_rng(_RNG_SEED), most
        self._at_work: dict[Task, int] = {}
        self._met: set[Task] = set()
        self._over, self._lock = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._kill)

    def __enter__(self) -> "Killer":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    @property
    def killed(self) -> int:
        """How many it killed."""
        return len(self._met)

    def started(self, task: Task, pid: int) -> None:
        """See `fleet.tasks.Started`."""
        with self._lock:
            self._at_work[task] = pid

    def ended(self, task: Task) -> None:
        """A task's worker is at work on it no more."""
        with self._lock:
            self._at_work.pop(task, None)

    def _kill(self) -> None:
        while self.killed < self._most and not self._over.wait(self._rng.uniform(*_PAUSE_S)):
            with self._lock, contextlib.suppress(ProcessLookupError):
                there = [task for task in self._at_work if task not in self._met]
                if there:
                    task = there[self._rng.integers(len(there))]
                    os.kill(self._at_work[task], signal.SIGKILL)
                    self._met.add(task)


def measure(quick: bool) -> Iterator[Row]:
    """All rows; quick: six logs."""
    with tempfile.TemporaryDirectory() as name:
        folder, count = Path(name), 6 if quick else _LOGS
        logs = prepare(folder, count)
        clean = _outputs(LocalWorkers(_WORKERS, command_line), logs, folder / "clean")
        yield _row("local workers", LocalWorkers(_WORKERS, command_line), logs, folder, clean)
        os.environ["RAY_AUTH_MODE"] = "disabled"
        with cluster(cpus=_WORKERS) as address:
            on_ray = RayWorkers(command_line, address, _WORKERS, say=lambda line: print(line, file=sys.stderr))
            yield _row("Ray", on_ray, logs, folder, clean)


def prepare(folder: Path, count: int) -> list[Path]:
    """Logs of a map that lies beside them."""
    first, site = write(folder / "map.mcap", messages(seed=0)), folder / "site.db"
    assert run_task(Task(first, site, ("map", str(first), "--map", str(site))), command_line).exit_code == 0
    return [write(folder / f"{i:02}.mcap", messages(seed=i + 1, count=200)) for i in range(count)]


def tasks_in(folder: Path, logs: Sequence[Path]) -> list[Task]:
    """One task for each log, with its output in a folder."""
    folder.mkdir()
    site = str(logs[0].with_name("site.db"))
    outputs = [folder / log.name for log in logs]
    return [
        Task(log, out, ("localize", str(log), "--map", site, "-o", str(out), "--set", "localize.max_sigma_m=0.4"))
        for log, out in zip(logs, outputs, strict=True)
    ]


def seconds_per_log(workers: Workers, tasks: Sequence[Task], count: int) -> tuple[float, float]:
    """The seconds until the first of `count` workers begins, and the seconds per log once each has had two logs."""
    began, starts, warm = time.perf_counter(), list[float](), 2 * count
    run = workers.run(
        tasks, TaskLimits(), lambda _task, _pid: starts.append(time.perf_counter() - began), lambda _: None
    )
    ends = [time.perf_counter() for _ in run]
    return starts[0], (ends[-1] - ends[warm - 1]) / (len(ends) - warm)


def _outputs(workers: Workers, logs: Sequence[Path], folder: Path) -> dict[str, bytes]:
    ended = list(workers.run(tasks_in(folder, logs), TaskLimits(), lambda _task, _pid: None, lambda _task: None))
    assert all(one.exit_code == 0 for one in ended), ended
    return _files(folder)


def _files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def _row(name: str, workers: Workers, logs: Sequence[Path], folder: Path, clean: dict[str, bytes]) -> Row:
    """How many logs are not done, or another, or too much."""
    began, into = time.perf_counter(), folder / name.replace(" ", "_")
    ended: list[Ended] = []
    with Killer(most=len(logs) // 2) as killer:
        for one in workers.run(tasks_in(into, logs), TaskLimits(), killer.started, lambda _task: None):
            killer.ended(one.task)
            ended.append(one)
            left = f"{len(logs) - len(ended)} left, {killer.killed} killed"
            print(
                f"{name}: {one.task.log.name} ends with {one.exit_code} at try {one.attempts}; {left}", file=sys.stderr
            )
    seconds, found = time.perf_counter() - began, _files(into)
    failed = sum(one.exit_code != 0 for one in ended)
    other = sum(found.get(file) != clean.get(file) for file in found.keys() | clean.keys())
    peers = {"killed": killer.killed, "tried twice": sum(one.attempts == 2 for one in ended), "seconds": round(seconds)}
    return Row(f"kills, {name}", failed + other, "logs not done or other", at_most=0, cases=len(logs), peers=peers)


if __name__ == "__main__":
    sys.exit(main(measure, "Workers killed during a batch."))
