"""The actors of a batch on Ray: which of them works on what, and what becomes of the tasks of those that are lost."""

import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import ray
from ray import ObjectRef
from ray.actor import ActorHandle
from ray.exceptions import RayError

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fleet.cuts import clear, over_time, was_killed
from mcap_landmarks.fleet.on_ray.ray_actor import LAST_WORDS_S, FleetActor, Greeting
from mcap_landmarks.fleet.tasks import TRIES, CommandLine, Ended, Started, Task, TaskLimits, Waits
from mcap_landmarks.manifest import code_hash
from mcap_landmarks.wording import counted

_Ref = ObjectRef[Greeting] | ObjectRef[Ended]
_LOOK_S = 1.0
_TELL_S, _PATIENCE_S = 10.0, 900.0
"""How long the cluster may leave us without any worker before that is said, and before we give up: one that grows when
it is asked to starts a machine and fetches an image in one to ten minutes."""
_DYING_S = 0.05
"""How long to wait for the end of a process that was killed."""
_GRACE_S = LAST_WORDS_S + 5.0
"""How long after its limit an actor may still say itself that its task took too long."""


@dataclass(frozen=True, slots=True)
class Needs:
    """How many actors are asked for, and whether each takes a GPU beside its CPU."""

    actors: int
    on_gpu: bool

    def __str__(self) -> str:
        return f"{counted(self.actors, 'worker')} of one CPU{' and one GPU' if self.on_gpu else ''} each"


@dataclass(slots=True, eq=False)
class _Member:
    """One actor, and what it does: it greets until it has, then it works on a task or is idle.

    Of its processes the one that lived an `earlier` life must not work any more; `is_killed` says that it was killed.
    """

    actor: "ActorHandle[FleetActor]"
    greeting: Greeting | None = None
    earlier: str = ""
    is_killed: bool = False
    task: Task | None = None
    attempt: int = 0
    began: float = 0.0


class Crew:
    """Actors that work on tasks, each on one at a time.

    Raises:
        ToolkitError: no node can run them.
        ConnectionError: the cluster does not answer any more, if it is reached as ray://.
    """

    def __init__(self, needs: Needs, limits: TaskLimits, say: Callable[[str], None]) -> None:
        self._needs, self._limits, self._say = needs, limits, say
        self._awaited: dict[_Ref, _Member] = {}
        self._idle: list[_Member] = []
        self._given_up: list[Task] = []
        self._refused: dict[str, str] = {}
        self._told, self._alone_since = False, time.monotonic()

    def begin(self, command_line: CommandLine, folder: Path) -> None:
        """Ask the cluster for the actors, and do not wait for them."""
        # Ray puts another process into the place of one that ended; what becomes of its task is decided here. `stop`
        # is called beside `run`.
        options = {"num_cpus": 1, "num_gpus": int(self._needs.on_gpu), "max_restarts": -1, "max_concurrency": 2}
        made = ray.remote(FleetActor).options(**options)
        for _ in range(self._needs.actors):
            self._greet(_Member(cast("ActorHandle[FleetActor]", made.remote(command_line, folder))))

    def run(self, tasks: Sequence[Task], started: Started, waits: Waits) -> Iterator[Ended]:
        """Work on all tasks; how each ended, in the order in which they end.

        Raises:
            ToolkitError, ConnectionError: as above.
        """
        queue, left = deque((task, 1) for task in tasks), len(tasks)
        while left:
            while queue and self._idle:
                self._start(self._idle.pop(), *queue.popleft(), started)
            for ended in self._ended():
                if ended.cut is not None and ended.attempts < TRIES:
                    queue.append((ended.task, ended.attempts + 1))
                    waits(ended.task)
                else:
                    left -= 1
                    self._given_up += [ended.task] if ended.cut is not None else []
                    yield ended
            self._be_patient()

    def dismiss(self) -> None:
        """End all actors; those that work clean up first, and what others left is removed."""
        working = {ref: member for ref, member in self._awaited.items() if member.task is not None}
        with contextlib.suppress(RayError, ConnectionError):
            for member in working.values():
                member.actor.stop.remote()
            if working:
                ray.wait([*working], num_returns=len(working), timeout=LAST_WORDS_S)
            for member in (*self._awaited.values(), *self._idle):
                ray.kill(member.actor)
        self._awaited.clear()
        self._idle.clear()
        for task in self._given_up:
            clear(task)

    def _greet(self, member: _Member) -> None:
        member.task = None
        self._awaited[member.actor.greet.remote()] = member

    def _replace(self, member: _Member, *, kill: bool) -> None:
        """Have another process in the place of an actor's. Of one that ended by itself a kill would meet the next."""
        member.earlier = member.greeting.life if member.greeting else ""
        if kill:
            ray.kill(member.actor, no_restart=False)
        member.is_killed = kill
        self._greet(member)

    def _start(self, member: _Member, task: Task, attempt: int, started: Started) -> None:
        assert member.greeting is not None  # noqa: S101 - only who has greeted becomes idle
        member.task, member.attempt, member.began = task, attempt, time.monotonic()
        started(task, member.greeting.pid)
        self._awaited[member.actor.run.remote(task, self._limits, attempt)] = member

    def _ended(self) -> Iterator[Ended]:
        """The tasks that have ended or were lost, within a second."""
        for ref in ray.wait([*self._awaited], timeout=_LOOK_S)[0] if self._awaited else ():
            member = self._awaited.pop(ref)
            if member.task is None:
                self._greeted(ref, member)
            else:
                yield self._outcome(ref, member, member.task)
        for ref, member in [*self._awaited.items()]:
            if member.task is not None and self._is_overdue(member):
                del self._awaited[ref]
                ended = over_time(member.task, self._limits, _age(member), None, member.attempt)
                self._replace(member, kill=True)
                yield ended

    def _greeted(self, ref: _Ref, member: _Member) -> None:
        try:
            greeting = ray.get(ref)
        except RayError as error:
            self._refuse(member, "a worker", f"does not start ({_last_line(error)}); {INSTALL}")
            return
        assert isinstance(greeting, Greeting)  # noqa: S101 - as `greet` is called
        if greeting.life == member.earlier:
            if not member.is_killed:  # only the way to it broke off
                self._replace(member, kill=True)
            else:
                time.sleep(_DYING_S)
                self._greet(member)
        elif greeting.code == code_hash():
            member.greeting = greeting
            self._idle.append(member)
        else:
            theirs = f"{greeting.version}, code {greeting.code[:8]}"
            self._refuse(member, f"node {greeting.node}", f"runs another mcap-landmarks ({theirs}); {INSTALL}")

    def _refuse(self, member: _Member, who: str, why: str) -> None:
        """Go on without an actor, and say so once per node."""
        ray.kill(member.actor)
        if who not in self._refused:
            self._refused[who] = why
            self._say(f"warning: {who} {why}")
        if not self._awaited and not self._idle:
            raise ToolkitError(f"no worker is left: {who} {why}")

    def _outcome(self, ref: _Ref, member: _Member, task: Task) -> Ended:
        try:
            ended = ray.get(ref)
        except RayError:  # its process may go on, where only the way to it broke off
            self._replace(member, kill=False)
            return was_killed(task, None, _age(member), None, member.attempt)
        assert isinstance(ended, Ended)  # noqa: S101 - as `run` is called
        if ended.cut is None:
            member.task = None
            self._idle.append(member)
        else:  # what it was at goes on in there
            self._replace(member, kill=True)
        return ended

    def _is_overdue(self, member: _Member) -> bool:
        limit = self._limits.seconds
        return limit is not None and _age(member) > limit + _GRACE_S

    def _be_patient(self) -> None:
        """Say what is waited for where there is no worker, and wait no longer than it takes to get one.

        Raises:
            ToolkitError: none came.
        """
        now = time.monotonic()
        if self._idle or any(member.task is not None for member in self._awaited.values()):
            self._alone_since, self._told = now, False
            return
        alone_s = now - self._alone_since
        if alone_s < _TELL_S or (self._told and alone_s < _PATIENCE_S):
            return
        there, free = ray.cluster_resources(), ray.available_resources()
        have = ", ".join(f"{free.get(name, 0):g} of {there.get(name, 0):g} {name}s free" for name in ("CPU", "GPU"))
        if alone_s >= _PATIENCE_S:
            raise ToolkitError(
                f"no worker in {_PATIENCE_S / 60:.0f} minutes: {self._needs} were asked for, the cluster has {have}; "
                "let it grow, or wait until others are done with it"
            )
        self._told = True
        self._say(f"note: waiting for {self._needs}; the cluster has {have}")


INSTALL = "install the same mcap-landmarks and ray on all nodes"


def _age(member: _Member) -> float:
    """The seconds since its task began."""
    return time.monotonic() - member.began


def _last_line(error: RayError) -> str:
    return str(error).strip().splitlines()[-1].strip()
