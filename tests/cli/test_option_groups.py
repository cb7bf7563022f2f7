"""Groups of options: typer sees single options, the command gets them whole."""

import inspect
from pathlib import Path
from typing import Annotated

import pytest
import typer
from mcap_landmarks.cli import options
from mcap_landmarks.cli.option_groups import LogOptions, ScanOptions, spread
from mcap_landmarks.errors import UsageError
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


@pytest.mark.parametrize(
    ("scans", "complaint"),
    [
        (ScanOptions(scan=["/a"], scan_from="/b"), "--scan-from takes the place of --scan"),
        (ScanOptions(scan=["/a", "/b", "/c"]), "--scan /a /b /c: two are the most"),
    ],
)
def test_scans_that_do_not_go_together(scans: ScanOptions, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        scans.topics()


def test_a_slice_is_a_setting() -> None:
    assert ScanOptions(heights="-0.1:0.25").settings() == ["cluster.slice_m=[-0.1, 0.25]"]
    assert ScanOptions().settings() == []
    for heights in ("0.3:0.1", "0.3", "a:b"):
        with pytest.raises(UsageError, match="give two heights in metres"):
            ScanOptions(heights=heights).settings()
