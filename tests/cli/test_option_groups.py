"""Groups of options: typer sees single options, the command gets them whole."""

import inspect
from pathlib import Path
from typing import Annotated

import typer
from mcap_landmarks.cli import options
from mcap_landmarks.cli.option_groups import LogOptions, ScanOptions, spread
from typer.testing import CliRunner

taken: list[object] = []


def command(
    log: Annotated[Path, typer.Argument()], scans: ScanOptions, given: LogOptions, output: options.MaybeOutput = None
) -> None:
    """What it does."""
    taken.append((log, scans, given, output))


def test_a_group_is_spread_behind_the_options_of_the_command_itself() -> None:
    names = list(inspect.signature(spread(command)).parameters)
    assert names[:5] == ["log", "output", "scan", "scan_from", "heights"]
    assert names[5:] == list(inspect.signature(LogOptions).parameters)
    assert spread(command).__doc__ == "What it does."


def test_the_command_gets_its_groups_whole() -> None:
    app = typer.Typer()
    app.command()(spread(command))
    words = ["a.mcap", "--scan", "/one", "--scan", "/two", "--set", "fuse.x=1", "--force", "-o", "b.mcap"]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert taken == [
        (
            Path("a.mcap"),
            ScanOptions(scan=["/one", "/two"]),
            LogOptions(settings=["fuse.x=1"], force=True),
            Path("b.mcap"),
        )
    ]
    assert CliRunner().invoke(app, ["a.mcap", "--image", "/camera"]).exit_code == 2
