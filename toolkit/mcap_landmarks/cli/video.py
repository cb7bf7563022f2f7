"""Make a video of a log: images with boxes beside the map, the path and the pose so far."""

from fractions import Fraction
from typing import Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location, size_of
from mcap_landmarks.wording import counted

_SMALLEST_PX, _LARGEST_PX, _MOST_FPS = 160, 4096, 240
"""Below, no text can be read; above, H.264 has no level."""


@reading_logs
def command(
    result: Annotated[
        Location, typer.Argument(metavar="RESULT", parser=location, help="A log with images, scans or poses.")
    ],
    output: options.Output,
    fps: Annotated[float, typer.Option("--fps", help="Pictures per second; the video runs in real time.")] = 10.0,
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Pixels of the video.")] = "1280x720",
    start: options.Start = None,
    end: options.End = None,
    image: Annotated[
        str | None, typer.Option("--image", metavar="TOPIC", help="Image topic, where the log has several.")
    ] = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Write a video (.mp4) of RESULT: its images with boxes, and the map with landmarks, path, pose and scan."""
    from mcap_landmarks.atomic import atomic_path
    from mcap_landmarks.moments import time_ns
    from mcap_landmarks.report.drive_video import VideoForm, make_video
    from mcap_landmarks.runs.replacing import new_files

    if output.suffix.lower() != ".mp4":
        raise UsageError(f"{output}: the name does not tell the format; use .mp4")
    span = time_ns(start, "--start"), time_ns(end, "--end")
    form = VideoForm(_size(size), _rate(fps), *span, image)
    with (
        new_files([output], [result], overwrite=overwrite),
        atomic_path(output) as target,
        progress(f"draw {result.name}", size_of(result) or None) as advance,
    ):
        made = make_video(result, target, form, advance)
    seconds = float(made.pictures / form.fps)
    if json:
        width, height = form.size
        told = {"output": str(output), "pictures": made.pictures, "seconds": seconds, "fps": float(form.fps)}
        say_json(
            "video", {**told, "size_px": [width, height], "topics": list(made.topics), "losses": list(made.losses)}
        )
    else:
        say(f"{output}: {counted(made.pictures, 'picture')}, {seconds:.1f} s of {', '.join(made.topics)}")
    for loss in made.losses:
        warn(f"warning: {result}: {loss}")
    if made.losses:
        raise typer.Exit(PARTIAL)


def _size(text: str) -> tuple[int, int]:
    """Width and height; H.264 halves both for its colours, so they are even.

    Raises:
        UsageError: the text is no such size.
    """
    parts = text.lower().split("x")
    if len(parts) == 2 and all(part.isascii() and part.isdigit() for part in parts):
        width, height = map(int, parts)
        if all(_SMALLEST_PX <= side <= _LARGEST_PX and side % 2 == 0 for side in (width, height)):
            return width, height
    raise UsageError(f"--size {text}: give two even numbers from {_SMALLEST_PX} to {_LARGEST_PX}, such as 1280x720")


def _rate(fps: float) -> Fraction:
    if not 0 < fps <= _MOST_FPS:
        raise UsageError(f"--fps {fps:g}: give a number above 0 and up to {_MOST_FPS}")
    return Fraction(fps).limit_denominator(1000)
