"""The command as `batch` starts it: it ends with the process that started it, also when that one is killed.

Else it would go on for nobody, and keep the next run from its output.
"""

import os
import signal
import threading

from mcap_landmarks.__main__ import run


def end_with_input() -> None:
    """Nothing is ever written to the input, a pipe, which ends as soon as nobody could."""
    os.read(0, 1)
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    threading.Thread(target=end_with_input, daemon=True).start()
    run()
