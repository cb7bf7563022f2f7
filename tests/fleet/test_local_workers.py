"""Processes that run tasks: they live long, and whatever becomes of one costs its task a retry, and no other's."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import psutil
import pytest
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits

from tests.fleet.toy_command import toy

pytestmark = pytest.mark.slow


def task(action: str, path: Path) -> Task:
    return Task(Path("a.mcap"), path, (action, str(path)))


def run(tasks: Sequence[Task], workers: int = 1, limits: TaskLimits = TaskLimits()) -> dict[str, Ended]:  # noqa: B008
    """The ends by verb."""
    return {
        one.task.verb: one
        for one in LocalWorkers(workers, toy).run(tasks, limits, lambda _task, _pid: None, lambda _task: None)
    }


def test_a_worker_lives_on_and_uses_one_thread(tmp_path: Path) -> None:
    told: list[tuple[Task, int]] = []
    tasks = [task("tiny", tmp_path / str(i)) for i in range(4)]
    ended = list(
        LocalWorkers(1, toy).run(tasks, TaskLimits(), lambda one, pid: told.append((one, pid)), lambda _task: None)
    )
    assert [one.task for one in ended] == [one for one, _ in told] == tasks
    assert {one.stdout for one in ended} == {f"{told[0][1]} 1\n"}
    assert all(one.exit_code == 0 and one.peak_bytes for one in ended)


def test_what_is_killed_gets_one_retry_and_stops_no_other(tmp_path: Path) -> None:
    """Also one that fails by itself: it would again, and gets none."""
    names = ("die", "die_once", "fail", "tiny")
    waited: list[str] = []
    tasks, workers = [task(name, tmp_path / name) for name in names], LocalWorkers(2, toy)
    ends = workers.run(tasks, TaskLimits(), lambda _task, _pid: None, lambda one: waited.append(one.verb))
    ended = {one.task.verb: one for one in ends}
    assert sorted(waited) == ["die", "die_once"]
    assert {name: (one.exit_code, one.attempts, one.cut) for name, one in ended.items()} == {
        "die": (-9, 2, "killed"),
        "die_once": (0, 2, None),
        "fail": (1, 1, None),
        "tiny": (0, 1, None),
    }
    assert "error: a.mcap: die was killed by signal 9" in ended["die"].stderr
    assert ended["die_once"].stdout == "alive\n"


def test_limits_end_a_task_and_say_so(tmp_path: Path) -> None:
    ended = run([task("hang", tmp_path / "x"), task("tiny", tmp_path / "y")], limits=TaskLimits(seconds=1.0))
    assert (ended["hang"].cut, ended["hang"].attempts, ended["tiny"].exit_code) == ("time", 2, 0)
    assert "error: a.mcap: hang was ended after its --time-limit of 1 s; give it more" in ended["hang"].stderr
    assert not (tmp_path / "x.partial").exists(), "it may clean up"

    ended = run([task("grow", tmp_path / "x")], limits=TaskLimits(memory_bytes=400_000_000))
    assert (ended["grow"].cut, ended["grow"].attempts) == ("memory", 2)
    assert "more than its --memory-limit of 400.0 MB" in ended["grow"].stderr
    assert (ended["grow"].peak_bytes or 0) > 400_000_000


def test_an_idle_worker_that_is_killed_is_replaced(tmp_path: Path) -> None:
    pids: list[int] = []
    tasks = [task("tiny", tmp_path / str(i)) for i in range(3)]
    for count, _ in enumerate(
        LocalWorkers(1, toy).run(tasks, TaskLimits(), lambda _task, pid: pids.append(pid), lambda _task: None)
    ):
        if count == 0:
            os.kill(pids[0], signal.SIGKILL)
            time.sleep(0.3)
    assert len(set(pids)) > 1


def test_breaking_off_lets_the_running_ones_clean_up(tmp_path: Path) -> None:
    """As Ctrl-C and SIGTERM do: the iteration is closed by what they raise."""
    pids: list[int] = []
    tasks = [task("hang", tmp_path / "x"), task("tiny", tmp_path / "y"), task("hang", tmp_path / "z")]
    ends = LocalWorkers(2, toy).run(tasks, TaskLimits(), lambda _task, pid: pids.append(pid), lambda _task: None)
    assert next(ends).task.verb == "tiny"
    while not (tmp_path / "x.partial").exists():
        time.sleep(0.01)
    ends.close()  # type: ignore[attr-defined] # it is a generator
    assert list(tmp_path.iterdir()) == []
    assert not any(psutil.pid_exists(pid) for pid in pids)


ORPHANED = """
import sys
from pathlib import Path
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Task, TaskLimits
from tests.fleet.toy_command import toy
if __name__ == "__main__":
    task = Task(Path("a.mcap"), Path(sys.argv[1]), ("hang", sys.argv[1]))
    list(LocalWorkers(1, toy).run([task], TaskLimits(), lambda _task, pid: print(pid, flush=True), print))
"""


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    """Else they would go on for nobody, and keep the next run from its outputs."""
    script = tmp_path / "orphaned.py"
    script.write_text(ORPHANED)
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path.cwd()), *sys.path])}
    words = [sys.executable, str(script), str(tmp_path / "x")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=paths) as parent:
        assert parent.stdout is not None
        worker = psutil.Process(int(parent.stdout.readline()))
        parent.kill()
        worker.wait(30)
