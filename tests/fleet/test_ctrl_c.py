"""A worker takes no Ctrl-C from the moment it is started: the terminal sends that to all, and the batch ends it."""

import signal
from concurrent.futures import Future
from multiprocessing import resource_tracker
from pathlib import Path

import pytest
from mcap_landmarks.fleet import local_workers
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Ended, Task, TaskLimits

from tests.fleet.toy_command import toy


class PoolThatSpawns:
    """What the first process of a pool does before it is started: the tracker is there, and the mask is inherited."""

    blocked: set[int]

    def __init__(self, *_given: object, **_named: object) -> None:
        pass

    def schedule(self, _function: object, work: tuple[Task, object, int] | None = None, **_named: object) -> object:
        """See `pebble.ProcessPool`."""
        future: Future[object] = Future()
        if work is None:
            resource_tracker.ensure_running()
            PoolThatSpawns.blocked = set(signal.pthread_sigmask(signal.SIG_BLOCK, []))
            future.set_result(1)
        else:
            future.set_result(Ended(work[0], 0, "", "", 0.0, None, 1))
        return future

    def stop(self) -> None:
        """See `pebble.ProcessPool`."""

    join = stop


def test_sigint_is_blocked_when_a_worker_is_spawned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also the first, with which Python starts its tracker of resources: that unblocks SIGINT."""
    tracker = resource_tracker.ResourceTracker()
    monkeypatch.setattr(resource_tracker, "ensure_running", tracker.ensure_running)
    monkeypatch.setattr(local_workers, "ProcessPool", PoolThatSpawns)
    task = Task(Path("a.mcap"), Path("x"), ("tiny", "x"))
    assert len(list(LocalWorkers(1, toy).run([task], TaskLimits(), lambda _task, _pid: None, lambda _task: None))) == 1
    assert signal.SIGINT in PoolThatSpawns.blocked
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
