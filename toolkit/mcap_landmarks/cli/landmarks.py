"""Import, export and show landmark databases."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, say_json, table, warn
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mcap_landmarks.maps.exchange import Format
    from mcap_landmarks.maps.model import LandmarkMap

app = typer.Typer(no_args_is_help=True, help=__doc__)

Database = Annotated[
    Location, typer.Argument(metavar="MAP.db", parser=location, help="Landmark database (SQLite file).")
]
Form = Annotated[
    str | None,
    typer.Option("--format", metavar="thesis|csv|json", help="By default what FILE's name says: .txt, .csv, .json."),
]
Replace = Annotated[bool, typer.Option("--overwrite", help="Replace an existing file; never the input.")]


@app.command("import")
def import_file(
    database: Database,
    file: Annotated[
        Location,
        typer.Argument(metavar="FILE", parser=location, help="Landmarks: the thesis's Appendix C, CSV or JSON."),
    ],
    form: Form = None,
    overwrite: Replace = False,
) -> None:
    """Make the landmark database MAP.db from FILE."""
    from mcap_landmarks.maps.database import write_map
    from mcap_landmarks.maps.exchange import import_map
    from mcap_landmarks.runs.replacing import new_files

    with new_files([database], [file], overwrite=overwrite):
        landmark_map = import_map(file, _format(file, form))
        write_map(database, landmark_map)
    say(f"{database}: {_size(landmark_map)}")


@app.command("export")
def export_file(
    database: Database,
    file: Annotated[Location, typer.Argument(metavar="FILE", parser=location, help="Where to write.")],
    form: Form = None,
    overwrite: Replace = False,
) -> None:
    """Write MAP.db to FILE: its groups as Appendix C has them, its landmarks as CSV, or everything as JSON."""
    from mcap_landmarks.maps.database import read_map
    from mcap_landmarks.maps.exchange import Format, export_map
    from mcap_landmarks.runs.replacing import new_files

    with new_files([file], [database], overwrite=overwrite):
        landmark_map, chosen = read_map(database), _format(file, form)
        export_map(file, landmark_map, chosen)
    say(f"{file}: {_size(landmark_map)}")
    tentative = int(landmark_map.tentative.sum())
    if chosen is Format.CSV and tentative:
        warn(f"note: {counted(tentative, 'tentative landmark')} left out; JSON holds all")
    lone = len(landmark_map) - len({identity for group in landmark_map.groups for identity in group.landmark_ids})
    if chosen is Format.THESIS and lone:
        warn(f"note: {counted(lone, 'landmark')} in no group left out; CSV and JSON hold all")


@app.command()
def show(database: Database, json: options.Json = False) -> None:
    """Print the landmarks, groups and sources of MAP.db."""
    from mcap_landmarks.maps.database import read_map
    from mcap_landmarks.maps.exchange_json import document

    landmark_map = read_map(database)
    if json:
        content = document(landmark_map)
        del content["schema"]
        say_json("landmarks", content)
    else:
        _print(database, landmark_map)


def _marks(landmark_map: "LandmarkMap") -> "Iterator[str]":
    """What is to be known of each landmark beside its class."""
    for tentative, movable in zip(landmark_map.tentative, landmark_map.movable, strict=True):
        told = ", ".join(word for word, holds in (("tentative", tentative), ("movable", movable)) if holds)
        yield f" ({told})" if told else ""


def _print(database: Location, landmark_map: "LandmarkMap") -> None:
    import numpy as np

    say(f"{database}: {_size(landmark_map)} in frame {landmark_map.frame}")
    for source in landmark_map.sources:
        used = f", {source.used} of {counted(source.bundles, 'bundle')} used" if source.kind == "recording" else ""
        say(f"from {source.kind} {source.fingerprint[:12]}{used}")
    sigma_m = np.sqrt(np.linalg.eigvalsh(landmark_map.covariances)[:, -1]) if len(landmark_map) else np.zeros(0)
    rows = [
        [
            identity,
            landmark_map.classes[i] + mark,
            *(f"{value:.4f}" for value in landmark_map.positions_xy[i]),
            f"{sigma_m[i]:.4f}" if sigma_m[i] > 0 else "-",
            f"{landmark_map.radii_m[i]:.3f}" if landmark_map.radii_m[i] > 0 else "-",
            str(landmark_map.sightings[i]),
        ]
        for i, (identity, mark) in enumerate(zip(landmark_map.ids, _marks(landmark_map), strict=True))
    ]
    say()
    table(["id", "class", "x [m]", "y [m]", "sigma [m]", "radius [m]", "sightings"], rows)
    if landmark_map.groups:
        say()
        groups = [
            [str(number), " ".join(group.landmark_ids), *(f"{value:.4f}" for value in group.map_from_base)]
            for number, group in enumerate(landmark_map.groups, start=1)
        ]
        table(["group", "landmarks, left to right", "x [m]", "y [m]", "heading [rad]"], groups)


def _size(landmark_map: "LandmarkMap") -> str:
    counts = [(len(landmark_map), "landmark"), (len(landmark_map.groups), "group")]
    return " and ".join(counted(count, name) for count, name in counts if count) or "no landmarks"


def _format(file: Location, form: str | None) -> "Format":
    from mcap_landmarks.errors import UsageError
    from mcap_landmarks.maps.exchange import Format, format_of

    if form is None:
        return format_of(file)
    try:
        return Format(form.lower())
    except ValueError:
        raise UsageError(f"--format {form}: choose {', '.join(Format)}") from None
