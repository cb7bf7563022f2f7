"""Make a layout for Foxglove or Lichtblick: images with boxes, the map in 3D, plots of positions and of the status."""

import json as json_text
from typing import Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location, size_of
from mcap_landmarks.wording import counted


@reading_logs
def command(
    result: Annotated[Location, typer.Argument(metavar="RESULT", parser=location, help="A log with results.")],
    output: options.Output,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Write a layout that Foxglove and Lichtblick import as it is; it names nothing that RESULT does not have."""
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.report.layout_file import read_layout
    from mcap_landmarks.runs.replacing import consists_of, output_to

    with progress(f"read {result.name}", size_of(result) or None) as advance:
        made = read_layout(result, advance)
    content = (json_text.dumps(made.document, indent=2) + "\n").encode()
    with output_to(output, [result], consists_of(content), overwrite=overwrite), atomic_file(output) as stream:
        stream.write(content)
    if json:
        left_out = [{"topic": topic, "reason": reason} for topic, reason in made.left_out.items()]
        told = {"output": str(output), "panels": list(made.panels), "topics": list(made.topics), "left_out": left_out}
        say_json("foxglove", {**told, "losses": list(made.losses)})
    else:
        say(f"{output}: {counted(len(made.panels), 'panel')} of {counted(len(made.topics), 'topic')}")
    for topic, reason in made.left_out.items():
        warn(f"note: {result}: {topic} is not in the 3D panel: {reason}")
    for loss in made.losses:
        warn(f"warning: {result}: {loss}")
    if made.losses:
        raise typer.Exit(PARTIAL)
