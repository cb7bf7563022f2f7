"""Workers on a Ray cluster of this machine: whatever becomes of an actor costs its task one retry, and no other's."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType

import psutil
import pytest
from mcap_landmarks.cli.batch_options import provider_of
from mcap_landmarks.cli.main import run as command_line
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.fleet.tasks import CommandLine, Ended, Task, TaskLimits

from tests.cli.calls import call, refused
from tests.fleet.clusters import cluster, free_port
from tests.fleet.toy_command import toy

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning"),  # Ray leaves sockets and files to the collector
]
ray = pytest.importorskip("ray")
from mcap_landmarks.fleet.on_ray import ray_crew  # noqa: E402 - not without ray
from mcap_landmarks.fleet.on_ray.ray_actor import FleetActor  # noqa: E402
from mcap_landmarks.fleet.on_ray.ray_workers import RayWorkers  # noqa: E402

NO_LIMITS = TaskLimits()
DEMO = Path(__file__).parents[2] / "recordings" / "demo_localize.mcap"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A cluster, which the tests of this module share with one connection."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_AUTH_MODE", "disabled")
        with cluster(cpus=2) as there:
            ray.init(there, log_to_driver=False, logging_level="critical")
            try:
                yield there
            finally:
                ray.shutdown()


def task(action: str, path: Path) -> Task:
    path.parent.joinpath("a.mcap").touch()
    return Task(path.parent / "a.mcap", path, (action, str(path)))


def workers(address: str, command: CommandLine = toy) -> RayWorkers:
    return RayWorkers(command, address, 2, say=lambda _: None)


def run(
    address: str,
    tasks: Sequence[Task],
    limits: TaskLimits = NO_LIMITS,
    started: Callable[[Task, int], None] = lambda _task, _pid: None,
    command: CommandLine = toy,
) -> dict[str, Ended]:
    """The ends by output."""
    return {
        Path(str(one.task.output)).name: one
        for one in workers(address, command).run(tasks, limits, started, lambda _task: None)
    }


def test_what_is_killed_hangs_or_grows_gets_one_retry_and_stops_no_other(address: str, tmp_path: Path) -> None:
    names = ("spin", "grow", "die", "die_once", "fail", "tiny")
    told: list[tuple[str, int]] = []
    limits = TaskLimits(seconds=4.0, memory_bytes=600_000_000)
    tasks = [task(name, tmp_path / name) for name in names]
    ended = run(address, tasks, limits, lambda one, pid: told.append((one.verb, pid)))
    assert {name: (one.exit_code, one.attempts, one.cut) for name, one in ended.items()} == {
        "spin": (-9, 2, "time"),
        "grow": (-9, 2, "memory"),
        "die": (-9, 2, "killed"),
        "die_once": (0, 2, None),
        "fail": (1, 1, None),
        "tiny": (0, 1, None),
    }
    assert "a.mcap: die was killed by signal 9; if nobody did that" in ended["die"].stderr
    assert "was ended after its --time-limit of 4 s" in ended["spin"].stderr
    assert "more than its --memory-limit of 600.0 MB" in ended["grow"].stderr
    assert ended["die_once"].stdout == "alive\n"
    assert sorted(verb for verb, _ in told) == sorted([*names, "spin", "grow", "die", "die_once"])
    assert ended["tiny"].stdout.endswith(" 1\n"), "numeric libraries use one thread"


def test_logs_of_killed_workers_are_done_with_the_same_bytes(address: str, tmp_path: Path) -> None:
    """Where actors are killed in the middle of a verb, the results are those that nobody disturbed."""
    clean, killed = tmp_path / "clean", tmp_path / "killed"
    victims: list[int] = []

    def kill(_task: Task, pid: int) -> None:
        if len(victims) < 2:
            victims.append(pid)
            psutil.Process(pid).send_signal(signal.SIGKILL)

    tasks = []
    for folder in (clean, killed):
        folder.mkdir()
        words = ["--end", "1767225600500000000", "--set", "cluster.method=thesis"]
        outputs = [folder / f"{i}.mcap" for i in range(3)]
        tasks.append([Task(DEMO, out, ("cluster", str(DEMO), "-o", str(out), *words)) for out in outputs])
    assert call(*tasks[0][0].words) == 0
    ended = run(address, tasks[1], started=kill, command=command_line)
    assert sorted((one.exit_code, one.attempts) for one in ended.values()) == [(0, 1), (0, 2), (0, 2)]
    assert {out.read_bytes() for out in killed.iterdir()} == {(clean / "0.mcap").read_bytes()}
    assert sorted(path.name for path in killed.iterdir()) == ["0.mcap", "1.mcap", "2.mcap"]


def test_breaking_off_leaves_no_actor_and_nothing_half_written(address: str, tmp_path: Path) -> None:
    pids: list[int] = []
    tasks = [task("spin", tmp_path / "x"), task("tiny", tmp_path / "y"), task("spin", tmp_path / "z")]
    ends = workers(address).run(tasks, NO_LIMITS, lambda _task, pid: pids.append(pid), lambda _task: None)
    assert next(ends).task.verb == "tiny"
    while not (tmp_path / "x.partial").exists():
        time.sleep(0.01)
    assert isinstance(ends, Iterator)
    ends.close()  # type: ignore[attr-defined] # it is a generator
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    psutil.wait_procs([psutil.Process(pid) for pid in pids if psutil.pid_exists(pid)], timeout=30)
    assert not any(psutil.pid_exists(pid) for pid in pids)


def test_another_version_on_the_nodes_is_said(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_crew, "code_hash", lambda: "0" * 64)
    said: list[str] = []
    crew = RayWorkers(toy, address, 1, say=said.append)
    with pytest.raises(ToolkitError, match=r"no worker is left: node .* runs another mcap-landmarks .*; install the"):
        list(crew.run([task("tiny", tmp_path / "x")], NO_LIMITS, lambda _task, _pid: None, lambda _task: None))
    assert len(said) == 1


def test_a_program_that_the_nodes_lack_is_said(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ghost = ModuleType("ghost")
    exec("def command(words): pass", ghost.__dict__)  # noqa: S102 - a module that is nowhere else
    monkeypatch.setitem(sys.modules, "ghost", ghost)
    with pytest.raises(
        ToolkitError, match=r"no worker is left: a worker does not start \(.*ghost.*\); install the same"
    ):
        run(address, [task("tiny", tmp_path / "x")], command=ghost.command)


def test_what_a_cluster_has_no_room_for_is_not_waited_for_without_end(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray_crew, "_TELL_S", 0.0)
    monkeypatch.setattr(ray_crew, "_PATIENCE_S", 2.0)
    said: list[str] = []
    crew = RayWorkers(toy, address, 1, provider="cuda", say=said.append)
    with pytest.raises(
        ToolkitError, match="no worker in 0 minutes: 1 worker of one CPU and one GPU each were asked for"
    ):
        list(crew.run([task("tiny", tmp_path / "x")], NO_LIMITS, lambda _task, _pid: None, lambda _task: None))
    assert said == [
        "note: waiting for 1 worker of one CPU and one GPU each; the cluster has 2 of 2 CPUs free, 0 of 0 GPUs free"
    ]


@pytest.mark.parametrize(
    ("wrong", "error", "told"),
    [
        ("somewhere", UsageError, "name a cluster as auto, HOST:PORT"),
        ("127.0.0.1:", UsageError, "name a cluster as auto, HOST:PORT"),
        (f"127.0.0.1:{free_port()}", ToolkitError, "nobody answers there .*; check that `ray status`"),
        (f"ray://127.0.0.1:{free_port()}", ToolkitError, "nobody answers there .*; check host and port"),
    ],
    ids=["no-port", "empty-port", "nobody", "nobody-by-client"],  # tests are named alike in every process
)
def test_addresses_without_a_cluster_are_said(
    wrong: str, error: type[ToolkitError], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    with pytest.raises(error, match=told):
        run(wrong, [task("tiny", tmp_path / "x")])


def test_a_node_says_what_it_does_not_see(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "chdir", os.chdir)
    monkeypatch.chdir(tmp_path)
    lost = FleetActor(toy, tmp_path / "elsewhere")
    unseen = lost.run(Task(Path("a.mcap"), tmp_path / "out", ("tiny", "a.mcap")), NO_LIMITS, 1)
    assert unseen.exit_code == 2
    assert "error: a.mcap: node" in unseen.stderr
    assert "has no such file; put it on a file system that all nodes have" in unseen.stderr
    hinted = lost.run(task("fail", tmp_path / "x"), NO_LIMITS, 1)
    assert hinted.exit_code == 1
    assert f"has no folder {tmp_path / 'elsewhere'}, where the batch was started" in hinted.stderr
    seen = FleetActor(toy, tmp_path).run(task("fail", tmp_path / "x"), NO_LIMITS, 1)
    assert seen.stderr == f"error: {tmp_path / 'x'}: no\n"


def test_without_the_extra_its_name_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("mcap_landmarks.fleet.on_ray")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "ray", None)
    said = refused(capsys, 1, "batch", "cluster", DEMO, "-o", tmp_path / "out", "--ray", "auto")
    assert said == "error: ray is not installed: pip install 'mcap-landmarks[cluster]'"


@pytest.mark.parametrize(
    ("words", "provider"),
    [
        ("detect a.mcap --set detect.provider=cuda", "cuda"),
        ("detect a.mcap --set=detect.provider=auto", "auto"),
        ("detect a.mcap --set detect.threads=1 --config gpu.toml", "tensorrt"),
        ("cluster a.mcap", "cpu"),
    ],
)
def test_workers_take_a_gpu_if_their_network_does(
    words: str, provider: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("gpu.toml").write_text('[detect]\nprovider = "tensorrt"\n')
    assert provider_of(words.split()) == provider
