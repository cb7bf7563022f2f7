"""Processes over many logs: order, failures, Ctrl-C, and which logs and outputs are meant."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.runs.batch import ProcessTask, find_logs, outputs_in, run_tasks


def task(script: str, name: str = "log.mcap") -> ProcessTask:
    return ProcessTask(Path(name), Path("out.mcap"), (sys.executable, "-S", "-c", script))


def nothing(_: int) -> None:
    pass


def test_results_come_in_order_whatever_ends_first(tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    last_first = [task(f"open({str(gate)!r}).read(); print('first')"), task(f"open({str(gate)!r}, 'w'); print('last')")]
    ended = run_tasks(last_first, 2, nothing)
    assert [one.stdout.strip() for one in ended] == ["first", "last"]


def test_one_that_fails_or_is_killed_stops_no_other() -> None:
    scripts = ["raise SystemExit(3)", "import os; os.kill(os.getpid(), 9)", "import sys; print('é', file=sys.stderr)"]
    counted: list[int] = []
    ended = run_tasks([task(script) for script in scripts], 1, counted.append)
    assert [one.exit_code for one in ended] == [3, -signal.SIGKILL, 0]
    assert ended[2].stderr.strip() == "é"
    assert sum(counted) == 3


def test_numeric_libraries_get_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    (ended,) = run_tasks([task("import os; print(os.environ['OMP_NUM_THREADS'])")], 1, nothing)
    assert ended.stdout.strip() == "1"


def test_ctrl_c_lets_the_running_ones_clean_up_and_starts_no_more(tmp_path: Path) -> None:
    gate, cleaned, never = tmp_path / "gate", tmp_path / "cleaned", tmp_path / "never"
    os.mkfifo(gate)
    running = (  # which hears Ctrl-C also where the tests' own parent ignores it, as a shell's background jobs do
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"try:\n    open({str(gate)!r}, 'w').close()\n    signal.pause()\n"
        f"except KeyboardInterrupt:\n    open({str(cleaned)!r}, 'w').close()"
    )

    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_tasks([task(running), task(f"open({str(gate)!r}).read()")], 2, interrupt)
    assert cleaned.exists()
    waiting = [task("import signal; signal.pause()"), task(f"open({str(never)!r}, 'w')")]
    with pytest.raises(KeyboardInterrupt):
        run_tasks([task("pass"), *waiting], 1, interrupt)
    assert not never.exists()


def test_a_request_to_end_is_handed_on(tmp_path: Path) -> None:
    """SIGTERM, as `docker stop` sends it, of which the command makes an exit."""
    gate, cleaned = tmp_path / "gate", tmp_path / "cleaned"
    os.mkfifo(gate)
    running = (
        "import signal, sys\n"
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))\n"
        f"try:\n    open({str(gate)!r}, 'w').close()\n    signal.pause()\n"
        f"finally:\n    open({str(cleaned)!r}, 'w').close()"
    )

    def terminate(_: int) -> None:
        raise SystemExit(143)

    with pytest.raises(SystemExit):
        run_tasks([task(running), task(f"open({str(gate)!r}).read()")], 2, terminate)
    assert cleaned.exists()


def test_patterns_and_names_give_each_log_once(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.mcap", "deep/c.mcap", "x[1].mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    found = find_logs([str(tmp_path / "x[1].mcap"), str(tmp_path / "[ab].mcap"), str(tmp_path / "**" / "*.mcap")])
    assert [path.name for path in found] == ["x[1].mcap", "a.mcap", "b.mcap", "c.mcap"]
    with pytest.raises(UsageError, match=r"no\*: no file matches"):
        find_logs([str(tmp_path / "no*")])


def test_outputs_are_named_as_their_logs(tmp_path: Path) -> None:
    logs = [tmp_path / "a.mcap", tmp_path / "bag"]
    logs[0].touch()
    logs[1].mkdir()
    out = tmp_path / "out"
    out.mkdir()
    (out / "a.mcap").touch()
    assert outputs_in(out, [*logs, out / "a.mcap"], ".mcap") == {logs[0]: out / "a.mcap", logs[1]: out / "bag.mcap"}
    assert outputs_in(out, [out / "a.mcap"], ".json") == {out / "a.mcap": out / "a.json"}
    with pytest.raises(UsageError, match="all logs lie in the output folder"):
        outputs_in(out, [out / "a.mcap"], ".mcap")
    with pytest.raises(UsageError, match=r"also writes .*a\.mcap"):
        outputs_in(tmp_path, [tmp_path / "a.bag", out / "a.bag"], ".mcap")


ORPHANED = """
import sys
from pathlib import Path
from mcap_landmarks.runs.batch import ProcessTask, run_tasks
words = (sys.executable, "-c", "import os, sys; os.open(sys.argv[1], os.O_WRONLY); os.read(0, 1)", sys.argv[1])
run_tasks([ProcessTask(Path("log"), Path("out"), words)], 1, print)
"""


def test_the_processes_hear_that_theirs_was_killed(tmp_path: Path) -> None:
    """By the end of their input; else they would go on, and keep the next run from its outputs."""
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    killed = subprocess.Popen([sys.executable, "-c", ORPHANED, str(gate)])
    with gate.open("rb") as running:  # opens when the task's process runs, and ends with it
        killed.kill()
        killed.wait()
        assert running.read() == b""


def test_a_command_of_a_batch_ends_with_its_input() -> None:
    reading, writing = os.pipe()
    with subprocess.Popen([sys.executable, "-m", "mcap_landmarks.batched", "--version"], stdin=reading) as living:
        assert living.wait() == 0, "as long as the other end is open it does its work"
    os.close(writing)
    code = "from mcap_landmarks.batched import end_with_input; end_with_input()"
    assert subprocess.run([sys.executable, "-c", code], stdin=reading, check=False).returncode == -signal.SIGKILL
    os.close(reading)
