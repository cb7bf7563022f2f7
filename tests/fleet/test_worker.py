"""One task in this process: what it printed and how it ended, whatever a verb does, and nothing left for the next."""

import os
import sys
import warnings
from contextvars import ContextVar
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.fleet.tasks import CommandLine, Ended, Task
from mcap_landmarks.fleet.worker import run_task, use_one_thread

LEFT: ContextVar[str] = ContextVar("left", default="nothing")


def ended(command_line: CommandLine, *words: str) -> Ended:
    return run_task(Task(Path("a.mcap"), Path("out.mcap"), ("detect", *words)), command_line)


def test_what_is_printed_is_caught_also_below_python(capfd: pytest.CaptureFixture[str]) -> None:
    def prints(words: list[str]) -> None:
        print(f"é {words}")
        sys.stdout.flush()
        os.write(1, b"native\n")
        os.write(2, b"\xff warning\n")
        sys.exit(3)

    one = ended(prints, "--json")
    assert (one.exit_code, one.cut, one.attempts) == (3, None, 1)
    assert one.stdout == "é ['detect', '--json']\nnative\n"
    assert one.stderr == "\N{REPLACEMENT CHARACTER} warning\n"
    print("afterwards")
    assert capfd.readouterr() == ("afterwards\n", "")


@pytest.mark.parametrize(
    ("raised", "code", "cut", "said"),
    [
        (SystemExit(), 0, None, ""),
        (SystemExit("no"), 1, None, "error: no"),
        (KeyboardInterrupt(), 130, None, ""),
        (MemoryError(), 1, "memory", "error: a.mcap: detect ran out of memory; use fewer --workers"),
        (RuntimeError("a\nb"), 1, None, "error: a.mcap: detect failed unexpectedly (RuntimeError: a b); please report"),
    ],
)
def test_every_end_is_an_end_of_the_task_alone(raised: BaseException, code: int, cut: str | None, said: str) -> None:
    def raises(_words: list[str]) -> None:
        raise raised

    one = ended(raises)
    assert (one.exit_code, one.cut) == (code, cut)
    assert said in one.stderr


def test_nothing_is_left_for_the_next_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LEFT", raising=False)

    def leaves(_words: list[str]) -> None:
        LEFT.set("something")
        os.environ["LEFT"] = "something"
        os.chdir(tmp_path)
        warnings.simplefilter("ignore")

    before = Path.cwd(), sys.argv, sys.stdout, list(warnings.filters)
    ended(leaves)
    assert (Path.cwd(), sys.argv, sys.stdout, list(warnings.filters)) == before
    assert LEFT.get() == "nothing"
    assert "LEFT" not in os.environ


def test_the_peak_is_that_of_the_task() -> None:
    def large(_words: list[str]) -> None:
        np.ones(25_000_000)  # 200 MB

    first, second = ended(large), ended(lambda _words: None)
    assert first.peak_bytes is not None
    assert second.peak_bytes is not None
    assert first.peak_bytes - second.peak_bytes > 150e6
    assert first.seconds > 0


def test_numeric_libraries_get_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "VECLIB_MAXIMUM_THREADS"):
        monkeypatch.setenv(name, "7")
    use_one_thread()
    assert os.environ["OMP_NUM_THREADS"] == "1"
