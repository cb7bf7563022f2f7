"""A terminal whose keys come one by one, and which a drawing fills."""

import contextlib
import os
import select
import shutil
import signal
import sys
import termios
import tty
from collections.abc import Iterator, Sequence
from types import FrameType

from mcap_landmarks.cli.console import harmless
from mcap_landmarks.errors import UsageError

_OTHER_SCREEN, _OWN_SCREEN = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
"""Switch to a screen of its own without a cursor, and back to what was there (xterm's control sequences)."""
_HOME, _REST_OF_LINE, _REST_OF_SCREEN = "\x1b[H", "\x1b[K", "\x1b[J"
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Terminal:
    """Keys and drawings; made by `open_terminal`. `is_over` once it is lost, or a signal says to end."""

    def __init__(self, keyboard: int, screen: int) -> None:
        self.is_over = False
        self._keyboard, self._screen = keyboard, screen

    def keys(self, wait_s: float) -> str:
        """The keys that were pressed, after so many seconds without one; none where the terminal is lost."""
        if self.is_over or not select.select([self._keyboard], [], [], max(wait_s, 0.0))[0]:
            return ""
        try:
            pressed = os.read(self._keyboard, 1024)
        except OSError:
            pressed = b""
        self.is_over |= not pressed
        return pressed.decode(errors="ignore")

    def draw(self, lines: Sequence[str]) -> None:
        """Show lines in place of those before, as far as there is room."""
        columns, rows = shutil.get_terminal_size()
        shown = [f"{harmless(line)[: columns - 1]}{_REST_OF_LINE}" for line in lines[: rows - 1]]
        self.write(_HOME + "\n".join(shown) + _REST_OF_SCREEN)

    def write(self, text: str) -> None:
        """Send text as it is; a terminal that is lost takes none."""
        data = text.encode(errors="replace")
        while data and not self.is_over:
            try:
                data = data[os.write(self._screen, data) :]
            except OSError:
                self.is_over = True

    def end(self, _number: int, _frame: FrameType | None) -> None:
        """Take a signal that says to end."""
        self.is_over = True


def check_terminal() -> None:
    """Refuse to go on without a terminal.

    Raises:
        UsageError: input or output is none.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("there is no terminal to take keys from; over ssh, ask for one with ssh -t")


@contextlib.contextmanager
def open_terminal() -> Iterator[Terminal]:
    """The terminal of this process, as it was once the block ends; Ctrl-C, SIGTERM and its loss end nothing but it.

    Raises:
        UsageError: input or output is no terminal.
    """
    check_terminal()
    keyboard, screen = sys.stdin.fileno(), sys.stdout.fileno()
    terminal, before = Terminal(keyboard, screen), termios.tcgetattr(keyboard)
    handlers = {number: signal.signal(number, terminal.end) for number in _ENDS}
    try:
        tty.setcbreak(keyboard)
        terminal.write(_OTHER_SCREEN)
        yield terminal
    finally:
        terminal.is_over = False  # a lost one takes nothing, one that was ended gets its screen back
        terminal.write(_OWN_SCREEN)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(keyboard, termios.TCSADRAIN, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
