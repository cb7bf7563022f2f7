"""A command line for workers: what its words say happens, without the toolkit's verbs and their imports."""

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from mcap_landmarks.cli.console import heeding_signals


def toy(words: list[str]) -> None:
    """Do what the first word says, with a file that the second one names."""
    with heeding_signals():
        ACTIONS[words[0]](Path(words[-1]))


def tiny(_path: Path) -> None:
    """Tell which process it is, and how many threads its libraries may use."""
    print(os.getpid(), os.environ["OMP_NUM_THREADS"])


def fail(path: Path) -> None:
    """End as a verb does that cannot use a log."""
    print(f"error: {path}: no", file=sys.stderr)
    raise SystemExit(1)


def die_once(path: Path) -> None:
    """Be killed, but at the first time only."""
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    print("alive")


def die(_path: Path) -> None:
    """Be killed every time, and leave something half written."""
    os.kill(os.getpid(), signal.SIGKILL)


def hang(path: Path) -> None:
    """Wait for ever; what is half written goes when it is told to end."""
    partial = path.with_suffix(".partial")
    partial.touch()
    with contextlib.ExitStack() as stack:
        stack.callback(partial.unlink)
        time.sleep(3600)


def spin(path: Path) -> None:
    """As `hang`, but at work."""
    partial = path.with_suffix(".partial")
    partial.touch()
    with contextlib.ExitStack() as stack:
        stack.callback(partial.unlink)
        while True:
            time.sleep(0.001)


def grow(_path: Path) -> None:
    """Take more and more memory."""
    held = []
    while True:
        held.append(np.ones(2_500_000))
        time.sleep(0.005)


ACTIONS = {action.__name__: action for action in (tiny, fail, die_once, die, hang, spin, grow)}
