"""Nothing that is there gets lost, and every failure says so: in one line, as a document, with its exit code."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.cli.console import told_apart

from tests.cli.calls import call, refused, schema_of
from tests.cli.logs import messages, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs, and a map of the first."""
    here = tmp_path_factory.mktemp("outputs")
    write(here / "a.mcap", messages(seed=1, count=40))
    write(here / "b.mcap", messages(seed=2, count=40))
    assert call("map", here / "a.mcap", "--map", here / "a.db") == 0
    (here / "config.toml").touch()
    (here / "hard.mcap").hardlink_to(here / "a.mcap")
    (here / "soft.db").symlink_to(here / "a.db")
    return here


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("localize {0}/a.mcap --map {0}/a.db -o {0}/a.db", "is the input itself"),
        ("localize {0}/a.mcap --map {0}/a.db -o {0}/soft.db --overwrite", "a.db itself; write to another file"),
        ("localize {0}/a.mcap --map {0}/a.db -o {0}/hard.mcap --overwrite", "a.mcap itself; write to another file"),
        ("localize {0}/a.mcap --map {0}/a.db -o {0}/config.toml --config {0}/config.toml", "is the input itself"),
        ("localize {0}/a.mcap --map {0}/a.db -o {0}/b.mcap", "with --overwrite"),
        ("map {0}/a.mcap --map {0}/b.mcap", "with --overwrite"),
        ("map {0}/b.mcap --map {0}/a.db", "with --overwrite"),
        ("map {0}/a.mcap --map {0}/a.db --from-reference", "with --overwrite"),
        ("map {0}/a.mcap --map {0}/a.db --prior {0}/a.db --overwrite", "is the input itself"),
        ("map {0}/a.mcap --map {0}/new -o {0}/new", "two outputs would be this file"),
        ("evaluate {0}/a.mcap --tum {0}/a.mcap --overwrite", "is the input itself"),
        ("evaluate {0}/a.mcap --reference {0}/b.mcap --tum {0}/b.mcap --overwrite", "is the input itself"),
        ("evaluate {0}/a.mcap --tum {0}/config.toml", "with --overwrite"),
        ("convert {0}/a.mcap -o {0}/b.mcap", "with --overwrite"),
        ("recover {0}/a.mcap -o {0}/hard.mcap --overwrite", "a.mcap itself; write to another file"),
        ("convert {0}/a.mcap -o {0}/a.mcap --to rosbag2 --overwrite", "is the input itself"),
        ("foxglove {0}/a.mcap -o {0}/hard.mcap --overwrite", "a.mcap itself; write to another file"),
        ("landmarks export {0}/a.db {0}/a.db --overwrite", "is the input itself"),
        ("landmarks import {0}/a.db {0}/a.db --overwrite", "is the input itself"),
        ("export {0}/a.mcap --format tum -o {0}/hard.mcap --overwrite", "a.mcap itself; write to another file"),
        ("export {0}/a.mcap --format tum -o {0}/config.toml", "with --overwrite"),
        ("plot {0}/a.mcap -o {0}/a.mcap", "the name does not tell the format"),
        ("localize {0}/a.mcap --map {0}/a.db -o /dev/full", "is not a regular file"),
    ],
)
def test_what_is_there_stays(folder: Path, capsys: pytest.CaptureFixture[str], line: str, reason: str) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert reason in refused(capsys, 2, *line.format(folder).split())
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_parts_never_take_the_place_of_the_input(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes((folder / "a.mcap").read_bytes())
    (tmp_path / "a_0.mcap").hardlink_to(log)
    assert "is the input" in refused(capsys, 2, "convert", log, "-o", tmp_path, "--split-count", 50, "--overwrite")
    assert (tmp_path / "a.mcap").read_bytes() == (folder / "a.mcap").read_bytes()


@pytest.mark.parametrize(
    "line",
    [
        "convert {0}/a.mcap -o {1}/out.mcap --exclude /tf",
        "convert {0}/a.mcap -o {1}/parts --split-count 50",
        "convert {0}/a.mcap -o {1}/bag --to rosbag2",
        "convert {0}/a.mcap -o {1}/out.bag --to bag",
        "recover {0}/a.mcap -o {1}/out.mcap",
    ],
)
def test_where_nothing_more_can_be_written_nothing_is_left(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str
) -> None:
    """A limit of the size of files stands for a full disk."""
    earlier = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, earlier[1]))
    try:
        told = refused(capsys, 1, *line.format(folder, tmp_path).split())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, earlier)
    assert "cannot be written (File too large); free space or choose another place" in told
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_the_same_again_needs_no_word(folder: Path, tmp_path: Path) -> None:
    """And it may have other settings; what is to be overwritten is."""
    out, picture, text = tmp_path / "out.mcap", tmp_path / "plot.png", tmp_path / "poses.tum"
    for words in (
        ("localize", folder / "a.mcap", "--map", folder / "a.db", "-o", out),
        ("localize", folder / "a.mcap", "--map", folder / "a.db", "-o", out, "--set", "localize.max_sigma_m=0.4"),
        ("plot", out, "-o", picture),
        ("plot", out, "-o", picture, "--align"),
        ("evaluate", out, "--tum", text),
        ("evaluate", out, "--tum", text, "--overwrite"),
        ("localize", folder / "b.mcap", "--map", folder / "a.db", "-o", out, "--overwrite"),
    ):
        assert call(*words) == 0
    assert call("plot", out, "-o", picture) == 2  # of another log


def test_a_pipe_is_read_by_no_verb(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Which would wait for whoever writes it."""
    pipe = tmp_path / "pipe.mcap"
    os.mkfifo(pipe)
    for words in (
        ("info", pipe),
        ("localize", folder / "a.mcap", "--map", pipe, "-o", tmp_path / "out.mcap"),
        ("localize", folder / "a.mcap", "--map", folder / "a.db", "-o", tmp_path / "out.mcap", "--config", pipe),
        ("convert", pipe, "-o", tmp_path / "out.mcap"),
        ("evaluate", pipe),
    ):
        assert f"{pipe} is neither a file nor a folder" in refused(capsys, 2, *words)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe.mcap"]


def test_wrong_usage_leaves_no_folder(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = (folder / "a.mcap", folder / "b.mcap")
    refused(capsys, 2, "localize", *logs, "--map", folder / "a.db", "-o", tmp_path / "out", "--odom", "/none")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "code", "error", "remedy"),
    [
        ("info {0}/none.mcap", 1, "none.mcap: there is no such file or folder", "check the path"),
        ("localize {0}/a.mcap", 2, "Missing option '--map'.", "see mcap-landmarks localize --help"),
        ("info --nonsense", 2, "No such option: --nonsense", "see mcap-landmarks info --help"),
        ("nonsense", 2, "No such command 'nonsense'", "see mcap-landmarks --help"),
        ("batch plot {0}/a.mcap -o {0}/out", 2, "there is no such verb for many logs", "choose one of "),
    ],
)
def test_a_failure_is_a_document(
    folder: Path, capsys: pytest.CaptureFixture[str], line: str, code: int, error: str, remedy: str
) -> None:
    capsys.readouterr()
    assert call(*line.format(folder).split(), "--json") == code
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    jsonschema.validate(document, schema_of("error"))
    assert error in document["error"]
    assert document["remedy"].startswith(remedy)
    assert printed.err


def test_what_was_wrong_is_told_apart_from_what_to_do() -> None:
    assert told_apart("a: is gone; check the path") == ("a: is gone", "check the path")
    assert told_apart("a: is cut; it lacks b; copy it again") == ("a: is cut; it lacks b", "copy it again")
    assert told_apart("a: too few; drive on (found: 1; 2)") == ("a: too few", "drive on (found: 1; 2)")
    assert told_apart("a (1; 2) is odd") == ("a (1; 2) is odd", "")


STOPPED = """
import os, signal, sys
from pathlib import Path
from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.cli.console import heeding_signals, run_command
signal.signal(signal.SIGINT, signal.default_int_handler)

def work(*_, **__):
    with atomic_file(Path("out")) as stream:
        stream.write(b"half")
        os.kill(os.getpid(), int(sys.argv[1]))
        signal.pause()

with heeding_signals():
    code = run_command(work, ["--json"])
sys.exit(code)
"""


@pytest.mark.parametrize(("number", "code"), [(2, 130), (15, 143)])
def test_a_signal_ends_it_and_leaves_nothing(tmp_path: Path, number: int, code: int) -> None:
    done = subprocess.run([sys.executable, "-c", STOPPED, str(number)], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == code
    assert done.stderr.startswith(b"interrupted; nothing unfinished was left behind")
    assert json.loads(done.stdout)["error"] == "interrupted"
    assert list(tmp_path.iterdir()) == []


LOADING = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)

class Impatient:
    def find_spec(self, name, *_):
        if name == "typer":
            os.kill(os.getpid(), int(sys.argv[1]))

sys.meta_path.insert(0, Impatient())
from mcap_landmarks.__main__ import run
run()
"""


@pytest.mark.parametrize(("number", "code"), [(2, 130), (15, 143)])
def test_a_signal_while_modules_load_gives_no_traceback(number: int, code: int) -> None:
    done = subprocess.run([sys.executable, "-c", LOADING, str(number)], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (code, b"interrupted\n")


def test_what_cannot_be_printed_is_told() -> None:
    command = [sys.executable, "-m", "mcap_landmarks", "--version"]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(b"error: the output cannot be printed (No space left on device)")
