"""Write a trajectory for other tools: TUM, KITTI, CSV or JSON, with or without a truth."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location, size_of
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.evaluation.export import TrajectoryFormat


@reading_logs
def command(
    result: Annotated[Location, typer.Argument(metavar="RESULT", parser=location, help="A log with poses.")],
    output: options.Output,
    form: Annotated[str, typer.Option("--format", metavar="tum|kitti|csv|json", help="How to write it.")],
    topic: Annotated[
        str | None,
        typer.Option(
            "--topic",
            help="PoseStamped, PoseWithCovarianceStamped, Odometry or transforms. Default: what localize "
            "found, else what map found, else the truth, else odometry, else the poses of others.",
        ),
    ] = None,
    child: Annotated[
        str | None, typer.Option("--child", metavar="FRAME", help="Of transforms, those to this frame.")
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Write the poses of a topic of RESULT in the plane: position, heading, and covariance where the format has it."""
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.evaluation.export import render
    from mcap_landmarks.evaluation.pose_topics import read_poses
    from mcap_landmarks.runs.replacing import new_files

    chosen = _format(form)
    with new_files([output], [result], overwrite=overwrite):
        with progress(f"read {result.name}", size_of(result) or None) as advance:
            track = read_poses(result, topic, child, advance)
        text, notes = render(track, chosen)
        with atomic_file(output) as stream:
            stream.write(text.encode())
    if topic is None and track.others:
        warn(f"note: {result}: {track.topic} is taken; --topic chooses another: {', '.join(track.others)}")
    for note in (*track.notes, *notes):
        warn(f"note: {result}: {note}")
    say(f"{output}: {counted(len(track.trajectory), 'pose')} of {track.topic} in frame {track.frame or '(none named)'}")
    for loss in track.losses:
        warn(f"warning: {result}: {loss}")
    if track.losses:
        raise typer.Exit(PARTIAL)


def _format(text: str) -> "TrajectoryFormat":
    from mcap_landmarks.errors import UsageError
    from mcap_landmarks.evaluation.export import TrajectoryFormat

    try:
        return TrajectoryFormat(text.lower())
    except ValueError:
        raise UsageError(f"--format {text}: choose {', '.join(TrajectoryFormat)}") from None
