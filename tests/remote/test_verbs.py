"""What verbs make of logs and maps on a web server is byte for byte what they make of files of this machine."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from mcap_landmarks.remote import kept_parts

from tests.cli.calls import call
from tests.cli.logs import messages, write
from tests.remote.range_server import Served, serving


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """A log, its map, and itself with results."""
    folder = tmp_path_factory.mktemp("files")
    log, database, result = write(folder / "log.mcap", messages()), folder / "map.db", folder / "result.mcap"
    assert call("map", log, "--map", database) == 0
    assert call("localize", log, "--map", database, "-o", result) == 0
    return {path.name: path for path in (log, database, result)}


@pytest.fixture(scope="module")
def served(files: Mapping[str, Path]) -> Iterator[Served]:
    with serving() as found:
        found.files = {name: path.read_bytes() for name, path in files.items()}
        yield found


@pytest.fixture(autouse=True)
def _nothing_known() -> None:
    kept_parts.ALL.forget()


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> object:
    """The document of a verb, without the places that it names."""
    capsys.readouterr()
    assert call(*words, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    return {name: value for name, value in document.items() if name not in {"path", "output"}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verb", "name", "more"),
    [("info", "log.mcap", ()), ("info", "log.mcap", ("--check",)), ("evaluate", "result.mcap", ())],
)
def test_figures_are_the_same(
    verb: str,
    name: str,
    more: tuple[str, ...],
    files: Mapping[str, Path],
    served: Served,
    capsys: pytest.CaptureFixture[str],
) -> None:
    here, there = (printed(capsys, verb, place, *more) for place in (files[name], served.url(name)))
    assert here == there


@pytest.mark.slow
def test_outputs_are_the_same(files: Mapping[str, Path], served: Served, tmp_path: Path) -> None:
    log, database = served.url("log.mcap"), served.url("map.db")
    assert call("map", log, "--map", tmp_path / "map.db") == 0
    assert (tmp_path / "map.db").read_bytes() == files["map.db"].read_bytes()
    assert call("localize", log, "--map", database, "-o", tmp_path / "result.mcap") == 0
    assert (tmp_path / "result.mcap").read_bytes() == files["result.mcap"].read_bytes()
    for name, place in (("here", files["log.mcap"]), ("there", log)):
        assert call("convert", place, "-o", tmp_path / f"{name}.mcap") == 0
        assert call("export", place, "-o", tmp_path / f"{name}.tum", "--format", "tum", "--topic", "/odom") == 0
    for ending in ("mcap", "tum"):
        assert (tmp_path / f"here.{ending}").read_bytes() == (tmp_path / f"there.{ending}").read_bytes()
    assert call("diff", files["result.mcap"], served.url("result.mcap")) == 0
    assert call("diff", files["map.db"], database) == 0


@pytest.mark.slow
def test_results_of_a_file_here_are_reused_for_the_same_log_there(
    files: Mapping[str, Path], served: Served, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("localize", served.url("result.mcap"), "--map", files["map.db"], "-o", tmp_path / "again.mcap") == 0
    assert "localize reused" in capsys.readouterr().err
