"""What workers make: the bytes that a fresh process makes, whatever they did before and whoever kills them."""

import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from mcap_landmarks.cli.main import run
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits

from tests.cli.calls import call
from tests.cli.logs import messages, write
from tests.runs.chain import raw_log

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs with scene objects, one with scans, a map, and what fresh processes make of the former."""
    here = tmp_path_factory.mktemp("fleet")
    for seed, name in enumerate("ab", 1):
        write(here / f"{name}.mcap", messages(seed=seed, count=30))
    raw_log(here / "raw.mcap")
    assert call("map", here / "a.mcap", "--map", here / "a.db") == 0
    (here / "fresh").mkdir()
    finished([localizing(here, name, "fresh") for name in "ab"], workers=2)
    return here


def localizing(folder: Path, name: str, into: str, *options: str) -> Task:
    log, output = folder / f"{name}.mcap", folder / into / f"{name}.mcap"
    return Task(log, output, ("localize", str(log), "-o", str(output), "--map", str(folder / "a.db"), *options))


def finished(
    tasks: Sequence[Task], workers: int = 1, started: Callable[[Task, int], None] = lambda _task, _pid: None
) -> list[Ended]:
    ended = list(LocalWorkers(workers, run).run(tasks, TaskLimits(), started, lambda _task: None))
    assert [one.stderr for one in ended if one.exit_code] == []
    return ended


def test_nothing_of_a_task_is_left_for_the_next(folder: Path) -> None:
    """Another verb, read from the front and within little memory, then the same one with other settings."""
    (folder / "used").mkdir()
    raw, clusters = folder / "raw.mcap", folder / "used" / "raw.mcap"
    first = ("cluster", str(raw), "-o", str(clusters), "--lenient", "--max-memory", "16M", "--results-only")
    other = localizing(folder, "a", "used", "--set", "localize.max_sigma_m=0.3", "--method", "thesis", "--lenient")
    finished([Task(raw, clusters, first), other, localizing(folder, "b", "used")])
    assert (folder / "used" / "b.mcap").read_bytes() == (folder / "fresh" / "b.mcap").read_bytes()
    assert (folder / "used" / "a.mcap").read_bytes() != (folder / "fresh" / "a.mcap").read_bytes()


def test_workers_that_are_killed_change_no_result(folder: Path) -> None:
    """Each log's worker is killed once, as soon as it has the log."""
    (folder / "killed").mkdir()
    killed: set[str] = set()

    def kill_once(task: Task, pid: int) -> None:
        if task.log.name not in killed:
            killed.add(task.log.name)
            os.kill(pid, signal.SIGKILL)

    ended = finished([localizing(folder, name, "killed") for name in "ab"], 2, kill_once)
    assert [one.attempts for one in ended] == [2, 2]
    for name in "ab":
        assert (folder / "killed" / f"{name}.mcap").read_bytes() == (folder / "fresh" / f"{name}.mcap").read_bytes()
    assert sorted(path.name for path in (folder / "killed").iterdir()) == ["a.mcap", "b.mcap"]
