"""Workers that are actors of a Ray cluster: a node, a process or a log that fails costs its task one retry."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import ray

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fleet.on_ray.ray_connection import connected
from mcap_landmarks.fleet.on_ray.ray_crew import INSTALL, Crew, Needs
from mcap_landmarks.fleet.tasks import CommandLine, Ended, Started, Task, TaskLimits, Waits
from mcap_landmarks.vision.config import ProviderChoice


class RayWorkers:
    """Actors of a Ray cluster at an address (`auto`, `host:port`, `ray://host:port`, or `local` for one of their own).

    `wanted` is their number, by default one for each CPU that the cluster has. Each takes one CPU, and one GPU if the
    `provider` of their networks does, with `auto` if the cluster has any; then there is by default one for each of
    these. `say` is told what is waited for, and which nodes cannot be used.
    """

    def __init__(
        self,
        command_line: CommandLine,
        address: str,
        wanted: int | None = None,
        *,
        provider: ProviderChoice = "cpu",
        say: Callable[[str], None],
    ) -> None:
        self._command_line, self._address, self._wanted = command_line, address, wanted
        self._provider, self._say = provider, say

    def run(self, tasks: Sequence[Task], limits: TaskLimits, started: Started, waits: Waits) -> Iterator[Ended]:
        """See `Workers`.

        Raises:
            ToolkitError: the cluster does not answer, has no room for a worker, or runs another version of the toolkit.
        """
        with connected(self._address, self._wanted):
            there = ray.cluster_resources()
            on_gpu = self._provider not in ("cpu", "auto") or (self._provider == "auto" and there.get("GPU", 0) >= 1)
            wanted = self._wanted or max(1, int(there.get("GPU" if on_gpu else "CPU", 0)))
            needs = Needs(min(wanted, len(tasks)), on_gpu)
            crew = Crew(needs, limits, self._say)
            try:
                crew.begin(self._command_line, Path.cwd())
                yield from crew.run(tasks, started, waits)
            except ConnectionError as error:
                told = " ".join(str(error).split())
                raise ToolkitError(f"--ray {self._address}: {told}; {INSTALL}, and see that they are up") from error
            finally:
                crew.dismiss()
