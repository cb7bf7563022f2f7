"""The options of `diff`: those of two files, and those of two folders of logs."""

from dataclasses import dataclass
from typing import Annotated

import typer

from mcap_landmarks.atomic import check_target
from mcap_landmarks.cli import options
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, check_there, location

Baseline = Annotated[
    Location,
    typer.Argument(
        metavar="BASELINE",
        parser=location,
        help="A log with results, a MAP.db, a folder of logs, or a catalogue of a batch.",
    ),
]
Candidate = Annotated[
    Location | None,
    typer.Argument(
        metavar="CANDIDATE",
        parser=location,
        help="The same of another run; with --baseline this stands alone.",
        show_default=False,
    ),
]
Tolerance = Annotated[
    list[str] | None,
    typer.Option(
        "--tolerance",
        metavar="CHANNEL.FIELD=VALUE",
        help="How far a field may differ: 0.01, 1% or 0.01+1%; repeatable. Else as the stage declares.",
    ),
]
FailOn = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-on",
        metavar="CONDITION",
        help="Exit 1 if and only if one of these holds, such as 'position.rmse_m > 0.05', 'delta.position.rmse_m > "
        "0.01' or 'channels./landmarks/pose.removed > 0'; repeatable. With --criteria those decide, too.",
    ),
]
Truth = Annotated[
    Location | None,
    typer.Option(
        "--reference",
        parser=location,
        help="Where the truth is, for a side that has none: a log, or .tum; of folders also a folder of logs.",
    ),
]
Align = Annotated[
    bool, typer.Option("--align", help="Of databases: move the candidate by the one SE(2) that fits best.")
]
Drives = Annotated[
    bool | None,
    typer.Option(
        "--drives/--no-drives",
        help="Of logs: whether they are of two drives, which share no messages. Found out by default.",
        show_default=False,
    ),
]


@dataclass(frozen=True, slots=True)
class SetOptions:
    """What `diff` takes for two folders."""

    criteria: Annotated[
        Location | None,
        typer.Option(
            "--criteria", parser=location, metavar="FILE", help="Of folders: margins, and what fails, in a TOML file."
        ),
    ] = None
    blessed: Annotated[
        Location | None,
        typer.Option(
            "--baseline",
            parser=location,
            metavar="DIR",
            help="Compare CANDIDATE, named alone, with the blessed results in this folder.",
        ),
    ] = None
    bless: Annotated[
        bool, typer.Option("--bless", help="Keep the figures of CANDIDATE in --baseline DIR, as blessed.json.")
    ] = False
    junit: Annotated[
        Location | None,
        typer.Option("--junit", parser=location, metavar="FILE", help="Of folders: write the verdicts as JUnit XML."),
    ] = None
    markdown: Annotated[
        Location | None,
        typer.Option(
            "--markdown", parser=location, metavar="FILE", help="Of folders: write a summary for a pull request."
        ),
    ] = None

    overwrite: options.Overwrite = False

    def check_places(self) -> None:
        """Refuse what is not there or cannot be written, before anything is compared.

        Raises:
            UsageError, RemoteError: as it says.
        """
        for place in filter(None, (self.criteria, None if self.bless else self.blessed)):
            check_there(place)
        for place in filter(None, (self.junit, self.markdown)):
            check_target(place)

    def refuse_for_files(self) -> None:
        """Refuse what only two folders have.

        Raises:
            UsageError: an option is given.
        """
        given = {
            "--criteria": self.criteria,
            "--bless": self.bless,
            "--junit": self.junit,
            "--markdown": self.markdown,
        }
        names = [name for name, value in given.items() if value]
        if names:
            raise UsageError(f"{' and '.join(names)}: of two folders of logs; of two files there is --fail-on")
