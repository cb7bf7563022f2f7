"""Convert bags and data sets to MCAP."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.conversion_options import FormOptions, OutputName, SelectionOptions
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.runs.conversion import Converted
    from mcap_landmarks.runs.convert import Conversion


@reading_logs
def command(
    inputs: Annotated[
        list[Location],
        typer.Argument(
            metavar="SRC...", parser=location, help="ROS 1 .bag; ROS 2 folder, .db3 or .mcap; MRCLAM folder or .zip."
        ),
    ],
    output: OutputName,
    chosen: SelectionOptions,
    shape: FormOptions,
    distro: options.Distro = None,
    definitions: options.Definitions = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a log with a topic that cannot be understood; it is left out else.")
    ] = False,
    config_file: options.ConfigFile = None,
    settings: options.Set = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Convert SRC... to MCAP with every message, or tell which ones were lost.

    Several SRC with one file as output are merged by time, as the parts of a split bag are. A data set with several
    robots gives one file per robot, in a folder.
    """
    from mcap_landmarks.config import gather
    from mcap_landmarks.runs.convert import convert

    given = gather(config_file, settings or [], None)
    options.add_definitions(given, distro, definitions)
    form = shape.output(names_folder=output.endswith("/"))
    beside = [config_file] if config_file else []
    conversion = convert(
        inputs,
        location(output),
        chosen.selection(),
        given,
        progress,
        beside=beside,
        overwrite=overwrite,
        form=form,
        strict=strict,
    )
    for done in conversion.outputs:
        _report(done)
    for failure in conversion.failures:
        warn(f"error: {failure}")
    if json:
        say_json("convert", _document(conversion))
    else:
        _print(conversion)
    if conversion.failures or any(done.losses or done.lost or done.left_out for done in conversion.outputs):
        raise typer.Exit(PARTIAL)


def _report(done: "Converted") -> None:
    for note in done.notes:
        warn(f"note: {done.path}: {note}")
    for reason, count in sorted(done.dropped.items()):
        warn(f"note: {done.path}: left out {count}: {reason}")
    for topic in done.left_out:
        warn(f"warning: {done.path}: left out {topic.told}")
    for loss in done.losses:
        warn(f"warning: {done.path}: {loss}")
    if done.lost:
        warn(f"warning: {done.path}: {done.lost} of {done.declared} declared messages could not be read")


def _print(conversion: "Conversion") -> None:
    for done in conversion.outputs:
        name = f"{done.path}/" if isinstance(done.path, Path) and done.path.is_dir() else done.path
        say(f"{name}: {counted(done.topics.total(), 'message')}, {counted(len(done.topics), 'topic')}")


def _document(conversion: "Conversion") -> dict[str, object]:
    dropped: dict[str, int] = {}
    for done in conversion.outputs:
        for reason, count in sorted(done.dropped.items()):
            dropped[reason] = dropped.get(reason, 0) + count
    return {
        "outputs": [
            {
                "path": str(done.path),
                "format": done.format,
                "messages": done.topics.total(),
                "topics": dict(sorted(done.topics.items())),
            }
            for done in conversion.outputs
        ],
        "declared": sum(done.declared for done in conversion.outputs),
        "read": sum(done.topics.total() for done in conversion.outputs),
        "lost": sum(done.lost for done in conversion.outputs),
        "dropped": dropped,
        "left_out": [topic.entries() for done in conversion.outputs for topic in done.left_out],
        "losses": [loss for done in conversion.outputs for loss in done.losses],
        "failures": [str(failure) for failure in conversion.failures],
    }
