"""Workers on this machine: long-lived processes that outlast what becomes of a task, and end with this one."""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from multiprocessing import connection, resource_tracker
from queue import Empty, SimpleQueue

import psutil
from pebble import ProcessPool

from mcap_landmarks.fleet.cuts import clear, over_memory, over_time, was_killed
from mcap_landmarks.fleet.tasks import TRIES, CommandLine, Ended, Started, Task, TaskLimits, Waits
from mcap_landmarks.fleet.worker import INTERRUPTED, run_task, use_one_thread

_LAST_WORDS_S = 10.0
"""How long an interrupted process may clean up, as long as `docker stop` waits."""
_WATCH_S = 0.2
"""How often resident sizes are looked at: a process that fills memory as fast as it can (measured: 1.5 GB/s) is caught
300 MB above its limit."""


class LocalWorkers:
    """So many processes, each with the modules and the network that its tasks need, which it loads once.

    Each is a pebble pool of its own. In one pool of several a worker that is killed while it holds the lock of their
    common pipe keeps the others waiting for ever (1 of 2 batches of 200 tasks), and one that is killed while it waits
    breaks the pool.
    """

    def __init__(self, count: int, command_line: CommandLine) -> None:
        self._count, self._command_line = count, command_line

    def run(self, tasks: Sequence[Task], limits: TaskLimits, started: Started, waits: Waits) -> Iterator[Ended]:
        """See `fleet.tasks.Workers`."""
        waiting = deque((task, 1) for task in tasks)
        news = _News()
        with _crew(min(self._count, len(tasks)), self._command_line, news) as crew:
            while waiting or any(worker.job for worker in crew):
                for worker in crew:
                    if worker.job is None and waiting:
                        worker.begin(*waiting.popleft(), limits, started)
                ended = _next_end(crew, news, limits, started)
                if ended is None:
                    continue
                if ended.cut is not None and ended.attempts < TRIES:
                    waiting.append((ended.task, ended.attempts + 1))
                    waits(ended.task)
                    continue
                if ended.cut is not None:
                    clear(ended.task)
                yield ended


class _News(SimpleQueue["tuple[_Worker, Future[int] | Future[Ended]]"]):
    """What the processes tell: the worker, and what it promised."""


class _Job:
    """What a worker does at the moment."""

    def __init__(self, task: Task, attempt: int, future: "Future[Ended]") -> None:
        self.task, self.attempt, self.future = task, attempt, future
        self.began = time.monotonic()
        self.peak_bytes: int | None = None
        self.is_over = False
        self.looked = self.began


class _Worker:
    """One process at a time; where it is killed the next one takes its place."""

    def __init__(self, command_line: CommandLine, news: _News) -> None:
        self._command_line, self._news = command_line, news
        self._pool: ProcessPool | None = None
        self.job: _Job | None = None
        self.pid: int | None = None

    def begin(self, task: Task, attempt: int, limits: TaskLimits, started: Started) -> None:
        """Start a task, and the process first where there is none."""
        work = (task, self._command_line, attempt)
        try:
            future = (self._pool or self._start()).schedule(_work, work, timeout=limits.seconds)
        except RuntimeError:  # the process was killed while it waited for a task
            self.give_up()
            future = self._start().schedule(_work, work, timeout=limits.seconds)
        self.job = _Job(task, attempt, future)
        if self.pid is not None:
            started(task, self.pid)
        self._tell(future)

    def _start(self) -> ProcessPool:
        """Start a process that takes no Ctrl-C: the terminal sends that to all, and it is for us to end the others."""
        pool = self._pool = ProcessPool(1, initializer=_begin, context=multiprocessing.get_context("spawn"))
        resource_tracker.ensure_running()  # else the first process starts it, which lets SIGINT through again
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._tell(pool.schedule(os.getpid))
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        return pool

    def _tell(self, future: "Future[int] | Future[Ended]") -> None:
        future.add_done_callback(lambda _done: self._news.put((self, future)))

    def look(self, limits: TaskLimits) -> None:
        """Look how large the process is, if it was not for a while, and kill it where that is too much."""
        job, now = self.job, time.monotonic()
        if limits.memory_bytes is None or self.pid is None or job is None or now - job.looked < _WATCH_S:
            return
        job.looked = now
        with contextlib.suppress(psutil.Error):  # it has just ended
            job.peak_bytes = max(job.peak_bytes or 0, psutil.Process(self.pid).memory_info().rss)
            if job.peak_bytes > limits.memory_bytes and not job.is_over:
                job.is_over = True
                self.signal(signal.SIGKILL)

    def signal(self, number: signal.Signals) -> None:
        """Send the process a signal, if it is known and still there."""
        if self.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def end(self, limits: TaskLimits) -> Ended | None:
        """How the job ended; a process that did not outlast it is given up."""
        job, self.job = self.job, None
        if job is None:
            return None
        error = job.future.exception()
        if error is None:
            return job.future.result()
        self.give_up()
        seconds = time.monotonic() - job.began
        if isinstance(error, TimeoutError):
            return over_time(job.task, limits, seconds, job.peak_bytes, job.attempt)
        if job.is_over:
            return over_memory(job.task, limits, seconds, job.peak_bytes, job.attempt)
        return was_killed(job.task, getattr(error, "exitcode", None), seconds, job.peak_bytes, job.attempt)

    def give_up(self) -> None:
        """End the process without waiting for it."""
        pool, self._pool, self.pid = self._pool, None, None
        if pool is not None:
            pool.stop()
            threading.Thread(target=pool.join, daemon=True).start()

    def stop(self) -> Callable[[], None]:
        """Begin to end the process; what waits for that."""
        pool, self._pool = self._pool, None
        if pool is None:
            return lambda: None
        pool.stop()
        return pool.join


@contextlib.contextmanager
def _crew(count: int, command_line: CommandLine, news: _News) -> Iterator[list[_Worker]]:
    """Workers, which end with the block; what still runs is asked to, and may clean up."""
    crew = [_Worker(command_line, news) for _ in range(count)]
    try:
        yield crew
    finally:
        try:
            _interrupt(crew, news)
        finally:
            for join in [worker.stop() for worker in crew]:
                join()


def _interrupt(crew: Sequence[_Worker], news: _News) -> None:
    busy = {worker for worker in crew if worker.job is not None and worker.pid is not None}
    for worker in busy:
        worker.signal(signal.SIGTERM)
    until = time.monotonic() + _LAST_WORDS_S
    while busy and (left := until - time.monotonic()) > 0:
        with contextlib.suppress(Empty):
            worker, future = news.get(timeout=left)
            if worker.job is not None and worker.job.future is future:
                busy.discard(worker)
    for worker in busy:
        worker.signal(signal.SIGKILL)


def _next_end(crew: Sequence[_Worker], news: _News, limits: TaskLimits, started: Started) -> Ended | None:
    """The end of a task, None if none came for a while."""
    for one in crew:
        one.look(limits)
    try:
        worker, future = news.get(timeout=_WATCH_S)
    except Empty:
        return None
    if worker.job is None:
        return None
    if worker.job.future is future:
        return worker.end(limits)
    if future.exception() is None and isinstance(pid := future.result(), int):  # the first word of a new process
        worker.pid = pid
        started(worker.job.task, pid)
    return None


def _begin() -> None:
    """Prepare a new process; before anything large is imported."""
    use_one_thread()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Else it would go on for nobody, and keep the next run from its outputs."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGKILL)


def _work(task: Task, command_line: CommandLine, attempt: int) -> Ended:
    """A task in a worker; one that was told to end has cleaned up now, and does."""
    ended = run_task(task, command_line, attempt)
    if ended.exit_code in INTERRUPTED:
        os._exit(ended.exit_code)
    return ended
