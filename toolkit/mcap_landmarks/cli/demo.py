"""Build a map of one bundled log, localize another in it, and measure the error."""

from pathlib import Path
from typing import Annotated

import typer

from mcap_landmarks.cli.console import say
from mcap_landmarks.locations import Location, location


def command(
    output: Annotated[
        Location,
        typer.Option("-o", "--output", parser=location, help="Folder for the results; created if its parent exists."),
    ] = Path("mcap-landmarks-demo"),
) -> None:
    """Build a map of one bundled log, localize another in it, measure the error, draw it and write a page about it.

    Every step is a verb that works the same on your own logs; the command line of each is printed before it runs.
    """
    from mcap_landmarks.cli import evaluate, localize, plot, report
    from mcap_landmarks.cli import map as build
    from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions, SegmentOptions
    from mcap_landmarks.resources import resource
    from mcap_landmarks.runs.outputs import make_folder

    folder = make_folder(output)
    seen, asked = resource("recordings", "demo_map.mcap"), resource("recordings", "demo_localize.mcap")
    database, mapped, localized = folder / "map.db", folder / "mapped.mcap", folder / "localized.mcap"
    picture, page = folder / "localized.png", folder / "report.html"
    given = ImageOptions(), ScanOptions(), LogOptions(), SegmentOptions()

    say(f"$ mcap-landmarks map {seen} --map {database} -o {mapped}")
    build.command([seen], database, *given, output=mapped)
    say()
    say(f"$ mcap-landmarks localize {asked} --map {database} -o {localized}")
    localize.command([asked], database, *given, output=localized)
    say()
    say(f"$ mcap-landmarks evaluate {localized} --align")
    evaluate.command(localized, align=True)
    say()
    say(f"$ mcap-landmarks plot {localized} --align -o {picture}")
    plot.command([localized], picture, align=True)
    say()
    say(f"$ mcap-landmarks report {localized} --align -o {page}")
    report.command([localized], page, align=True)
