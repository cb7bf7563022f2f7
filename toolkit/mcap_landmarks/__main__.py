"""The command, also as `python -m mcap_landmarks`: a signal that comes while modules load ends it in one line."""

import gc
import os
import signal
from types import FrameType

_LOADED = 150_000
"""Objects after which garbage is first looked for: the modules of `convert` make 90,000, and all of them stay."""


def run() -> None:
    """Run the command line and exit with its code."""
    for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        if signal.getsignal(number) is default:  # who ignores it, as the shell for jobs in the background, goes on so
            signal.signal(number, _leave)
    _collect_late()
    from mcap_landmarks.cli.main import run as run_verb  # noqa: PLC0415 - takes half a second

    run_verb()


def _collect_late() -> None:
    """Look for garbage only behind the modules, and never among them: that takes a tenth of a second while they load.

    From the first time on it goes on as Python does by itself.
    """
    usual = gc.get_threshold()

    def go_on(phase: str, _about: dict[str, int]) -> None:
        if phase == "stop":
            gc.callbacks.remove(go_on)
            gc.freeze()
            gc.set_threshold(*usual)

    gc.callbacks.append(go_on)
    gc.set_threshold(_LOADED, *usual[1:])


def _leave(number: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(128 + number)


if __name__ == "__main__":
    run()
