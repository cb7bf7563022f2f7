"""The values that typer is spared: what they become is what typer makes of them, and convert loads no pydantic."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
import typer
from mcap_landmarks.cli.given_values import pass_on
from mcap_landmarks.locations import Location, location

from tests.sources.bags import write_ros2


def _command(found: list[object]) -> typer.Typer:
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)

    @app.command()
    def verb(
        inputs: Annotated[list[Location], typer.Argument(parser=location)],
        name: Annotated[str, typer.Option()],
        topics: Annotated[list[str] | None, typer.Option()] = None,
        place: Annotated[Location | None, typer.Option(parser=location)] = None,
        count: Annotated[int | None, typer.Option()] = None,
        shout: Annotated[str | None, typer.Option(callback=lambda text: text and text.upper())] = None,
        to: Annotated[str, typer.Option()] = "mcap",
        flag: Annotated[bool, typer.Option("--flag")] = False,
    ) -> None:
        found.append((inputs, name, topics, place, count, shout, to, flag))

    return app


@pytest.mark.parametrize(
    "words",
    [
        ["a", "--name", "x"],
        ["a", "s3://b/c", "--name", "", "--topics", "/a", "--topics", "/b", "--place", "d", "--count", "3", "--flag"],
        ["a", "--name", "x", "--shout", "low", "--to", "bag"],
    ],
)
def test_values_are_those_that_typer_makes(words: list[str]) -> None:
    found: list[object] = []
    for command in (typer.main.get_command(_command(found)), pass_on(typer.main.get_command(_command(found)))):
        command(words, standalone_mode=False)
    assert len(found) == 2
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("words", "told"),
    [([], "Missing"), (["a"], "Missing"), (["a", "--name", "x", "--count", "many"], "valid integer")],
)
def test_what_is_missing_or_no_number_is_refused_as_ever(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        pass_on(typer.main.get_command(_command([])))(words)
    assert stopped.value.code == 2
    assert told in capsys.readouterr().err


def test_converting_a_bag_loads_no_pydantic(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag")
    script = (
        "import sys\nfrom mcap_landmarks.cli.main import run\n"
        f"try: run(['convert', {str(bag)!r}, '-o', {str(tmp_path / 'out.mcap')!r}])\n"
        "except SystemExit as end: print(end.code, 'pydantic' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("0 False\n")
