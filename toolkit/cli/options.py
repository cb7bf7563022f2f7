"""Options that several verbs take, so that they read alike everywhere."""

import re
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.runs.bundles import Span

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Output = Annotated[
    Path, typer.Option("-o", "--output", help="Where to write: a file, or a folder for several outputs.")
]
MaybeOutput = Annotated[
    Path | None, typer.Option("-o", "--output", help="Where to write: a file, or a folder for several outputs.")
]
MapFile = Annotated[Path, typer.Option("--map", help="Landmark database (SQLite file).")]
ResultsOnly = Annotated[bool, typer.Option("--results-only", help="Write the new channels without the input's.")]
Start = Annotated[str | None, typer.Option("--start", help="First log time: RFC 3339 or integer nanoseconds.")]
End = Annotated[str | None, typer.Option("--end", help="Log time to stop before: RFC 3339 or integer nanoseconds.")]
Remap = Annotated[list[str] | None, typer.Option("--remap", metavar="FROM=TO", help="Read topic FROM as TO.")]
OdometryTopic = Annotated[str | None, typer.Option("--odom", help="Odometry topic, where the log has several.")]
ImageTopic = Annotated[str | None, typer.Option("--image", help="Image topic, where the log has several.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="TOML file with one table per stage.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="STAGE.KEY=VALUE", help="One setting; repeatable.")
]
Method = Annotated[str | None, typer.Option("--method", help="Sets the method of every stage: default or thesis.")]


def span(start: str | None, end: str | None, remaps: list[str] | None, topics: dict[str, str | None]) -> "Span":
    """What of a log to read, from the options; `topics` by role, None where none was chosen.

    Raises:
        UsageError: a time or a remapping cannot be read.
    """
    from toolkit.runs.bundles import Span
    from toolkit.runs.inputs import Choice, parse_remaps

    chosen = {role: topic for role, topic in topics.items() if topic}
    return Span(Choice(chosen, parse_remaps(remaps or [])), time_ns(start, "--start"), time_ns(end, "--end"))


def time_ns(text: str | None, option: str) -> int | None:
    """Nanoseconds since the epoch from RFC 3339 (an offset is required) or an integer.

    Raises:
        UsageError: the text is neither.
    """
    if text is None:
        return None
    if text.lstrip("-").isdigit():
        return int(text)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise UsageError(f"{option} {text}: give RFC 3339 with an offset, such as 2026-01-31T12:00:00Z, or nanoseconds")
    whole = moment.replace(microsecond=0)
    fraction = re.search(r"[.,](\d+)", text)  # datetime keeps microseconds only
    return int(whole.timestamp()) * 10**9 + (int(fraction[1].ljust(9, "0")[:9]) if fraction else 0)
