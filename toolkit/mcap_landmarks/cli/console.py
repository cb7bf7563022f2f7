"""What the verbs share with the terminal: results, warnings, progress, errors and exit codes."""

import contextlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence

from mcap_landmarks.errors import ToolkitError

DONE, UNUSABLE, USAGE, PARTIAL, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes: 2 is also what the shell's own tools mean by wrong usage, and 130 what it gives after Ctrl-C."""


def run_command(application: Callable[..., object], arguments: Sequence[str]) -> int:
    """Run a typer application and turn what it raises into one line on stderr and an exit code."""
    try:
        application(arguments, standalone_mode=True)
    except ToolkitError as error:
        warn(f"error: {error}")
        return error.exit_code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except (SystemExit, KeyboardInterrupt) as stop:
        if isinstance(stop, KeyboardInterrupt) or stop.code == INTERRUPTED:  # typer makes the one of the other
            warn("interrupted; nothing unfinished was left behind, and the next run goes on from finished stages")
            return INTERRUPTED
        return stop.code if isinstance(stop.code, int) else DONE
    return DONE


def warn(text: str) -> None:
    """One line on stderr."""
    print(" ".join(text.split()), file=sys.stderr)


def say(text: str = "") -> None:
    """A result on stdout."""
    print(text)


def say_json(verb: str, document: Mapping[str, object]) -> None:
    """The one document of `--json` on stdout; figures that are not finite become null, as JSON has none."""
    print(json.dumps({"schema": f"mcap-landmarks/{verb}/1", **_plain_entries(document)}, indent=2, ensure_ascii=False))


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
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    for row in (head, *rows):
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        say("  ".join(cells).rstrip())


@contextlib.contextmanager
def progress(label: str, total: int | None = None, unit: str = "bytes") -> Iterator[Callable[[int], None]]:
    """A bar on stderr while the block runs, if stderr is a terminal; the block calls it with each advance.

    It shows how much is done of what, how fast, and the time that is left. `unit` names what is counted.
    """
    if not sys.stderr.isatty():
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
    columns = [TextColumn("{task.description}"), BarColumn(), *amount, TimeRemainingColumn()]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)
        yield lambda advance: bar.update(task, advance=advance)
