"""The command, also as `python -m mcap_landmarks`: a signal that comes while modules load ends it in one line."""

import os
import signal
from types import FrameType


def run() -> None:
    """Run the command line and exit with its code."""
    for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        if signal.getsignal(number) is default:  # who ignores it, as the shell for jobs in the background, goes on so
            signal.signal(number, _leave)
    from mcap_landmarks.cli.main import run as run_verb  # noqa: PLC0415 - takes half a second

    run_verb()


def _leave(number: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(128 + number)


if __name__ == "__main__":
    run()
