"""What the bundled recordings give is what they gave before, within the tolerances that the stages declare.

`pytest --update-golden` writes the files beside this one anew; the commit then shows which results changed, and why.
"""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap_landmarks.cli.console import DONE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.resources import resource

GOLDEN = Path(__file__).parent
START_NS = 1_767_225_600 * 10**9
Make = Callable[[Path], None]


def run(*words: str | Path) -> int:
    return run_command(build(str(words[0])), [str(word) for word in words])


def span(seconds: int) -> tuple[str, ...]:
    return "--end", str(START_NS + seconds * 10**9)


def make_map(folder: Path) -> None:
    """A map of the first twenty seconds, from pixels, and the path that was driven meanwhile."""
    log = resource("recordings", "demo_map.mcap")
    assert run("map", log, "--map", folder / "map.db", "-o", folder / "map.mcap", "--results-only", *span(20)) == DONE


def make_localize(folder: Path) -> None:
    """Ten seconds in the surveyed map, from pixels, with the truth beside them."""
    log = resource("recordings", "demo_localize.mcap")
    assert run("map", log, "--map", folder / "surveyed.db", "--from-reference") == DONE
    where = "--map", folder / "surveyed.db", "-o", folder / "localize.mcap", "--results-only"
    assert run("localize", log, *where, *span(10)) == DONE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "names"),
    [(make_map, ("map.db", "map.mcap")), (make_localize, ("localize.mcap",))],
    ids=["map", "localize"],
)
def test_results_are_what_they_were(
    make: Make,
    names: tuple[str, ...],
    tmp_path: Path,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
) -> None:
    make(tmp_path)
    for name in names:
        if request.config.getoption("--update-golden"):
            (GOLDEN / name).write_bytes((tmp_path / name).read_bytes())
        capsys.readouterr()
        code = run("diff", GOLDEN / name, tmp_path / name)
        told = "".join(capsys.readouterr())
        assert code == DONE, f"{told}\n{name} has changed; if that is meant, run pytest --update-golden and commit it"
