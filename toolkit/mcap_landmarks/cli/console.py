"""What the verbs share with the terminal: results, warnings, progress, errors and exit codes."""

import contextlib
import json
import math
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FrameType

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.remote.shown_copies import as_named

DONE, UNUSABLE, USAGE, PARTIAL, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143
"""Exit codes: 2 is also what the shell's own tools mean by wrong usage, 130 and 143 its own of Ctrl-C and SIGTERM."""
_HARMFUL = re.compile(r"[\0-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""What acts on a terminal or forges lines: control characters of both sets, those that turn the direction of writing
(Unicode Standard Annex 9), line separators, and halves of pairs, which no encoding of text has."""
_bars: list[object] = []
"""The bar that is shown."""
_HELP = "see mcap-landmarks --help"
_STOPPED = "interrupted; nothing unfinished was left behind, and the next run goes on from finished stages"


def run_command(application: Callable[..., object], arguments: Sequence[str], help_line: str = _HELP) -> int:
    """Run a typer application and turn what it raises into one line on stderr and an exit code.

    With --json among the arguments there is a document, too; `help_line` is the remedy where an error names none.
    """

    def fail(code: int, message: str, line: str | None) -> int:
        if line:
            warn(line)
        if "--json" in arguments:
            what, remedy = told_apart(message)
            say_json("error", {"error": what, "remedy": remedy or help_line})
        return code

    try:
        code = _exit_code(application, arguments, fail)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        warn(f"error: the output cannot be printed ({error.strerror}); free space or send it elsewhere")
        return UNUSABLE
    return code


def _exit_code(
    application: Callable[..., object], arguments: Sequence[str], fail: Callable[[int, str, str | None], int]
) -> int:
    try:
        application(arguments, standalone_mode=True)
    except ToolkitError as error:
        return fail(error.exit_code, str(error), f"error: {error}")
    except KeyboardInterrupt:
        return fail(INTERRUPTED, _STOPPED, _STOPPED)
    except SystemExit as stop:
        if stop.code in {
            INTERRUPTED,
            TERMINATED,
        }:  # typer makes the former of Ctrl-C, the latter is of `heeding_signals`
            return fail(int(stop.code), _STOPPED, _STOPPED)
        code = stop.code if isinstance(stop.code, int) else DONE
        wrong_usage = getattr(
            stop.__context__, "format_message", None
        )  # typer printed it, and exits while it handles it
        return fail(code, wrong_usage(), None) if wrong_usage else code
    return DONE


def told_apart(message: str) -> tuple[str, str]:
    """What was wrong, and what to do about it: messages are written as `what; remedy`; the latter may be missing."""
    what, semicolon, remedy = message.rpartition("; ")
    while semicolon and remedy.count("(") != remedy.count(")"):  # within a remark
        what, semicolon, more = what.rpartition("; ")
        remedy = f"{more}; {remedy}"
    return (what, remedy) if semicolon else (message, "")


@contextlib.contextmanager
def heeding_signals() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end what runs in the block as an exception does, so that everything is cleaned up."""
    ways = {signal.SIGINT: _interrupt, signal.SIGTERM: _terminate}
    before = {number: signal.getsignal(number) for number in ways}
    heeded = [number for number, how in before.items() if how is not signal.SIG_IGN]
    if threading.current_thread() is not threading.main_thread():
        heeded = []
    for number in heeded:
        signal.signal(number, ways[number])
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])


class _Interrupted(KeyboardInterrupt):
    """Ctrl-C. Of a plain KeyboardInterrupt that passes through `exec`, as dataclasses use it, CPython keeps in mind to
    kill its process at the end (`_Py_UnhandledKeyboardInterrupt`), whoever caught it.
    """


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise _Interrupted


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise SystemExit(TERMINATED)


def harmless(text: str) -> str:
    """A line without the control characters that names out of files may hold: those that part words become spaces."""
    return _HARMFUL.sub(lambda found: " " if found[0].isspace() else "", text)


def warn(text: str) -> None:
    """One line on stderr."""
    print(" ".join(harmless(as_named(text)).split()), file=sys.stderr)


def say(text: str = "") -> None:
    """One line of a result on stdout."""
    print(harmless(as_named(text)))


def say_json(verb: str, document: Mapping[str, object]) -> None:
    """The one document of `--json` on stdout; figures that are not finite become null, as JSON has none.

    Control characters in names are escaped, also those that JSON would let stand.
    """
    text = json.dumps({"schema": f"mcap-landmarks/{verb}/1", **_plain_entries(document)}, indent=2, ensure_ascii=False)
    text = as_named(text)
    print(_HARMFUL.sub(lambda found: found[0] if found[0] == "\n" else f"\\u{ord(found[0]):04x}", text))


def _plain_entries(entries: Mapping[str, object]) -> dict[str, object]:
    return {str(key): _plain(item) for key, item in entries.items()}


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return _plain_entries(value)
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Columns on stdout: the first flush left, the others flush right."""
    head, rows = [harmless(cell) for cell in head], [[harmless(cell) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    for row in (head, *rows):
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        say("  ".join(cells).rstrip())


@contextlib.contextmanager
def progress(label: str, total: int | None = None, unit: str = "bytes") -> Iterator[Callable[[int], None]]:
    """A bar on stderr while the block runs, if stderr is a terminal; the block calls it with each advance.

    It shows how much is done of what, how fast, and the time that is left. `unit` names what is counted. Within the
    block of another bar there is none: what is done there is part of that one's work.
    """
    if not sys.stderr.isatty() or _bars:
        yield lambda _advance: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """How many are done in a second."""

        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:.1f}/s" if task.speed else "")

    amount: list[ProgressColumn] = [DownloadColumn(), TransferSpeedColumn()]
    if unit != "bytes":
        amount = [MofNCompleteColumn(), TextColumn(unit), Rate()]
    columns = [TextColumn("{task.description}", markup=False), BarColumn(), *amount, TimeRemainingColumn()]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(harmless(label), total=total)
        _bars.append(bar)
        try:
            yield lambda advance: bar.update(task, advance=advance)
        finally:
            _bars.pop()
