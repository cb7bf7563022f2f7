"""Write a page to look at and to send: of one result, of what changed between two, or of many."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location, size_of

if TYPE_CHECKING:
    from mcap_landmarks.report.page.written_report import WrittenReport


@reading_logs
def command(
    results: Annotated[
        list[Location],
        typer.Argument(
            metavar="RESULT...",
            parser=location,
            help="Logs with results, a MAP.db, results.txt as in Appendix D, or a catalogue of a batch.",
        ),
    ],
    output: Annotated[
        Location, typer.Option("-o", "--output", parser=location, help="The page to write, such as report.html.")
    ],
    diff: Annotated[
        bool,
        typer.Option(
            "--diff", help="Take two results as BASELINE and CANDIDATE: both overlaid, the worst changes first."
        ),
    ] = False,
    align: Annotated[
        bool, typer.Option("--align", help="Move estimates by the SE(2) that fits the truth best.")
    ] = False,
    reference: Annotated[
        Location | None,
        typer.Option("--reference", parser=location, help="Where the truth is: a log, or a trajectory (.tum, .txt)."),
    ] = None,
    printed: Annotated[
        Location | None,
        typer.Option("--run", parser=location, help="What the run printed with --json, for the seconds of its stages."),
    ] = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Write one HTML file about RESULT that opens offline: map, errors, every bundle with its image and decision.

    Several results become a table to sort, the worst first; two with --diff one page of what changed. A catalogue
    stands for what the last run of each of its logs wrote.
    """
    from mcap_landmarks.report.page.given_results import given_results
    from mcap_landmarks.report.page.written_report import check_report, written_report
    from mcap_landmarks.runs.replacing import earlier_picture, output_to

    given = given_results(results, is_diff=diff)
    check_report(given, output, is_diff=diff, printed=printed)
    read = [*results, *given.files, *(file for file in (reference, printed) if file is not None)]
    with (
        output_to(output, read, earlier_picture("report", given.files), overwrite=overwrite),
        progress("read", sum(map(size_of, given.files)) or None) as advance,
    ):
        made = written_report(given, output, reference, printed=printed, is_diff=diff, aligned=align, progress=advance)
    for note in given.notes:
        warn(f"note: {note}")
    _tell(made, output, as_json=json)
    if made.losses:
        raise typer.Exit(PARTIAL)


def _tell(made: "WrittenReport", output: Location, *, as_json: bool) -> None:
    if as_json:
        say_json("report", {"output": str(output), **made.document})
    else:
        named = f"{', '.join(made.names[:3])}{' and more' if len(made.names) > 3 else ''}"
        say(f"{output}: {made.kind} of {named}, {len(made.page.content) / 1e6:.1f} MB")
        for line in made.page.thinned:
            say(line)
    for loss in made.losses:
        warn(f"warning: {loss}")
