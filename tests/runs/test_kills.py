"""What a killed process leaves: the old output or none, untouched inputs, and nothing that blocks the next run."""

import os
import signal
import sys
from pathlib import Path

import pytest

from tests.cli.calls import call
from tests.cli.logs import messages, write


def killed(words: list[object], folder: Path, event: str, count: int) -> int:
    """How a command ended in a process that is killed before it does something to its hidden files for the nth time."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left = count

    def heed(name: str, given: tuple[object, ...]) -> None:
        nonlocal left
        if name == event and str(given[0]).startswith(f"{folder}/."):
            left -= 1
            if not left:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(heed)
    try:
        call(*words)
    finally:
        os._exit(77)


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("line", "old", "event", "count"),
    [
        ("convert {0}/log.mcap -o {1}/out.mcap --exclude /odom", "", "open", 2),
        ("convert {0}/log.mcap -o {1}/out.mcap --overwrite", "out.mcap", "os.rename", 1),
        ("convert {0}/log.mcap -o {1} --split-count 40 --overwrite", "log_1.mcap", "open", 6),
        ("recover {0}/cut.mcap -o {1}/out.mcap", "", "os.rename", 1),
        ("localize {0}/log.mcap --map {0}/map.db -o {1}/out.mcap --overwrite", "out.mcap", "os.rename", 2),
        ("map {0}/log.mcap --map {1}/map.db", "", "os.rename", 1),
    ],
    ids=["convert", "convert again", "split", "recover", "localize", "map"],
)
def test_a_kill_leaves_the_old_or_nothing(
    logs: Path, tmp_path: Path, line: str, old: str, event: str, count: int
) -> None:
    words: list[object] = line.format(logs, tmp_path).split()
    inputs = files(logs)
    code = call(*words)
    clean = files(tmp_path)
    for path in tmp_path.iterdir():
        path.unlink()
    if old:
        (tmp_path / old).write_bytes(b"old")
    assert killed(words, tmp_path, event, count) == -signal.SIGKILL
    left = files(tmp_path)
    seen = {name: data for name, data in left.items() if not name.startswith(".")}
    assert seen.pop(old, b"old") == b"old"
    assert seen.items() <= clean.items(), "parts that were whole before may be there"
    assert any(name.startswith(".") for name in left), "it was killed in the midst of it"
    assert call(*words) == code
    assert files(tmp_path) == clean
    assert files(logs) == inputs


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, the same cut, and a map."""
    folder = tmp_path_factory.mktemp("logs")
    log = write(folder / "log.mcap", messages(count=30))
    (folder / "cut.mcap").write_bytes(log.read_bytes()[:-2000])
    assert call("map", log, "--map", folder / "map.db") == 0
    return folder
