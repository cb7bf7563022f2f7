"""Options that several verbs take, so that they read alike everywhere."""

import re
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.runs.bundles import Span
    from toolkit.runs.thinning import Thinning

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Output = Annotated[
    Path, typer.Option("-o", "--output", help="Where to write: a file, or a folder for several outputs.")
]
MaybeOutput = Annotated[
    Path | None, typer.Option("-o", "--output", help="Where to write: a file, or a folder for several outputs.")
]
MapFile = Annotated[Path, typer.Option("--map", help="Landmark database (SQLite file).")]
MaybeMapFile = Annotated[Path | None, typer.Option("--map", help="Landmark database (SQLite file).")]
ResultsOnly = Annotated[bool, typer.Option("--results-only", help="Write the new channels without the input's.")]
Start = Annotated[str | None, typer.Option("--start", help="First log time: RFC 3339 or integer nanoseconds.")]
End = Annotated[str | None, typer.Option("--end", help="Log time to stop before: RFC 3339 or integer nanoseconds.")]
Remap = Annotated[list[str] | None, typer.Option("--remap", metavar="FROM=TO", help="Read topic FROM as TO.")]
OdometryTopic = Annotated[str | None, typer.Option("--odom", help="Odometry topic, where the log has several.")]
ImageTopic = Annotated[str | None, typer.Option("--image", help="Image topic, where the log has several.")]
ScanTopics = Annotated[
    list[str] | None, typer.Option("--scan", help="Scan topic, where the log has several; twice for two LiDARs.")
]
ScanFrom = Annotated[
    str | None, typer.Option("--scan-from", metavar="TOPIC", help="Point cloud to take a slice of as the scan.")
]
Slice = Annotated[
    str | None,
    typer.Option("--slice", metavar="ZMIN:ZMAX", help="Heights of the slice above the base frame, in metres."),
]
ImageRate = Annotated[
    float | None, typer.Option("--image-rate", metavar="HZ", help="Leave out images that come faster than this.")
]
Every = Annotated[
    str | None,
    typer.Option("--every", metavar="0.2m,5deg", help="Leave out images until the robot moved or turned so far."),
]
Model = Annotated[Path | None, typer.Option("--model", help="Detector: any YOLOv5 export (ONNX).")]
Names = Annotated[Path | None, typer.Option("--names", help="Class names, one per line, where the model has none.")]
Extrinsics = Annotated[
    Path | None, typer.Option("--extrinsics", help="Where the sensors are on the robot, if the log does not say.")
]
Force = Annotated[bool, typer.Option("--force", help="Run every stage anew, also where its results are there.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="TOML file with one table per stage.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="STAGE.KEY=VALUE", help="One setting; repeatable.")
]
Method = Annotated[str | None, typer.Option("--method", help="Sets the method of every stage: default or thesis.")]


def span(
    start: str | None, end: str | None, remaps: list[str] | None, topics: dict[str, str | list[str] | None]
) -> "Span":
    """What of a log to read, from the options; `topics` by role, None where none was chosen, of scans up to two.

    Raises:
        UsageError: a time or a remapping cannot be read, or there are too many topics.
    """
    from toolkit.runs.bundles import Span
    from toolkit.runs.inputs import Choice, parse_remaps

    chosen = {role: topic for role, topic in topics.items() if isinstance(topic, str) and topic}
    for role, several in topics.items():
        if isinstance(several, list):
            if len(several) > 2:
                raise UsageError(f"--{role} {' '.join(several)}: two are the most that are merged")
            chosen.update(zip((role, f"second_{role}"), several, strict=False))
    return Span(Choice(chosen, parse_remaps(remaps or [])), time_ns(start, "--start"), time_ns(end, "--end"))


def scans(topics: list[str] | None, cloud: str | None) -> list[str] | None:
    """The topics to read scans from.

    Raises:
        UsageError: both are given.
    """
    if topics and cloud:
        raise UsageError("--scan-from takes the place of --scan; to merge a scan and a cloud give both with --scan")
    return [cloud] if cloud else topics


def sliced(settings: list[str] | None, heights: str | None) -> list[str]:
    """The settings with the one that a slice of a point cloud stands for.

    Raises:
        UsageError: the heights cannot be read.
    """
    if heights is None:
        return settings or []
    low, colon, high = heights.partition(":")
    try:
        slice_m = (float(low), float(high)) if colon else (0.0, 0.0)
    except ValueError:
        slice_m = (0.0, 0.0)
    if not slice_m[0] < slice_m[1]:
        raise UsageError(f"--slice {heights}: give two heights in metres, the lower one first, such as 0.1:0.3")
    return [*(settings or []), f"cluster.slice_m=[{slice_m[0]}, {slice_m[1]}]"]


def thinning(rate_hz: float | None, every: str | None) -> "Thinning":
    """Which images are left out.

    Raises:
        UsageError: an option cannot be read.
    """
    from toolkit.runs.thinning import parse_thinning

    return parse_thinning(rate_hz, every)


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
