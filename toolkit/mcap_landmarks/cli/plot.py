"""Plot maps and runs: landmarks, paths, positions and their errors."""

from enum import StrEnum
from functools import partial
from typing import Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location, size_of


class Show(StrEnum):
    """What a plot shows."""

    MAP = "map"
    POSITIONS = "positions"
    ERRORS = "errors"


@reading_logs
def command(
    inputs: Annotated[
        list[Location],
        typer.Argument(
            metavar="INPUT...", parser=location, help="Logs with results, a MAP.db, or results.txt as in Appendix D."
        ),
    ],
    output: options.Output,
    align: Annotated[
        bool, typer.Option("--align", help="Move estimates by the SE(2) that fits the truth best.")
    ] = False,
    show: Annotated[
        Show, typer.Option("--show", help="The map with its runs, positions beside the truth, or boxes of the errors.")
    ] = Show.MAP,
    title: Annotated[str, typer.Option("--title", help="A line above the plot.")] = "",
    overwrite: options.Overwrite = False,
) -> None:
    """Plot INPUT... into one picture (.png, .svg, .pdf): landmarks by class, paths, positions and their errors."""
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.evaluation.metrics import frame_note
    from mcap_landmarks.evaluation.pose_metrics import pose_errors, position_figures
    from mcap_landmarks.report.drawing import gather
    from mcap_landmarks.report.error_plots import errors_figure, positions_figure
    from mcap_landmarks.report.plots import figure, form_of, save
    from mcap_landmarks.runs.replacing import earlier_picture, output_to, picture_mark

    form = form_of(output)
    with output_to(output, inputs, earlier_picture("plot", inputs), overwrite=overwrite):
        with progress("read", sum(map(size_of, inputs))) as advance:
            drawing, losses = gather(inputs, aligned=align, progress=advance)
        draw = {Show.MAP: figure, Show.POSITIONS: positions_figure, Show.ERRORS: errors_figure}[show]
        with atomic_file(output) as stream:
            save(partial(draw, drawing, title), stream, form, picture_mark("plot", inputs))
    for run in drawing.runs:
        errors = pose_errors(run.scored.estimate, run.scored.reference)
        if note := frame_note(position_figures(errors), aligned=align):
            warn(f"note: {run.name}: {note}")
    for loss in losses:
        warn(f"warning: {loss}")
    if losses:
        raise typer.Exit(PARTIAL)
