"""Valid inputs with bits flipped, pieces cut, repeated or put in from others: no traceback, no hang."""

import contextlib
import io
import shutil
import signal
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FrameType

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.cli.calls import call
from tests.fuzz.corpus import seeds
from tests.fuzz.targets import FORMS, PARTS, TARGETS

MOST_SECONDS = 10
NO_SHRINKING = (Phase.generate,)
"""The inputs are small, and making one smaller that hangs takes minutes."""
EXAMPLES = {"mcap": 12, "bag": 12, "rosbag2": 12}
"""Where one takes long: of the others as many as there is time for."""
LOGS = {"mcap": "log.mcap", "bag": "log.bag", "db3": "log.db3", "rosbag2": "bag"}


@cache
def valid() -> dict[str, list[bytes]]:
    """The valid inputs of each target."""
    found: dict[str, list[bytes]] = {}
    for target, content in seeds():
        found.setdefault(target, []).append(content)
    return found


@st.composite
def mutated(draw: st.DrawFn, target: str) -> bytes:
    """One of a target's inputs after some mutations."""
    inputs = st.sampled_from(valid()[target])
    data = draw(inputs)
    for _ in range(draw(st.integers(1, 4))):
        place, length = draw(st.integers(0, len(data))), draw(st.integers(1, 64))
        stretch, other = data[place : place + length], draw(inputs)
        start = draw(st.integers(0, len(other)))
        data = draw(
            st.sampled_from(
                [
                    data[:place] + bytes(byte ^ 1 << place % 8 for byte in data[place : place + 1]) + data[place + 1 :],
                    data[:place],
                    data[:place] + data[place + length :],
                    data[:place] + stretch * 2 + data[place + length :],
                    data[:place] + other[start : start + length] + data[place:],
                    data[:place] + other[start:],
                    data[:place] + b"\xff" * min(length, 8) + data[place + min(length, 8) :],
                ]
            )
        )
    return data


@contextlib.contextmanager
def in_time() -> Iterator[None]:
    """Fail where the block takes longer than any small input may."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        pytest.fail(f"took more than {MOST_SECONDS} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(MOST_SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
@pytest.mark.parametrize("target", sorted(TARGETS))
def test_readers_raise_nothing_but_their_errors(target: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp(target)

    @settings(max_examples=EXAMPLES.get(target, 25), database=None, phases=NO_SHRINKING)
    @given(mutated(target))
    def check(data: bytes) -> None:
        with in_time():
            TARGETS[target](data, folder)

    check()


def quiet_call(words: list[object]) -> object:
    """The exit code of the command line, which prints nothing here."""
    nowhere = io.StringIO()
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere), in_time():
        return call(*words)


def write_log(target: str, data: bytes, folder: Path) -> Path:
    """A log of a target's bytes, where a user would have it."""
    path = folder / LOGS[target]
    if target == "rosbag2":
        about, _, content = data.partition(PARTS)
        path.mkdir()
        (path / "metadata.yaml").write_bytes(about)
        (path / "bag_0.db3").write_bytes(content)
    else:
        path.write_bytes(data)
    return path


def words_of(target: str, data: bytes, folder: Path) -> list[list[object]]:
    """The command lines that read an input."""
    output = folder / "out"
    if target == "maps":
        file = folder / f"map.{FORMS[data[0] % len(FORMS)] if data else FORMS[0]}"
        file.write_bytes(data[1:])
        return [["landmarks", "import", folder / "made.db", file, "--format", file.suffix[1:], "--overwrite"]]
    if target == "databases":
        (folder / "map.db").write_bytes(data)
        return [["landmarks", "show", folder / "map.db", "--json"]]
    if target == "settings":
        (folder / "given.toml").write_bytes(data[1:])
        return [["cluster", folder / "no.mcap", "-o", output, "--config", folder / "given.toml"]]
    log = write_log(target, data, folder)
    results = [[verb, log, "-o", output / f"{verb}.mcap", "--overwrite"] for verb in ("convert", "recover")]
    return [["info", log, "--json"], ["info", "--check", log], *results]


@pytest.mark.slow
@pytest.mark.parametrize("target", [*LOGS, "maps", "databases", "settings"])
def test_every_verb_ends_with_a_code_that_says_how(target: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp(target)

    @settings(max_examples=4, database=None, phases=NO_SHRINKING)
    @given(mutated(target))
    def check(data: bytes) -> None:
        with contextlib.suppress(FileNotFoundError):
            shutil.rmtree(folder)
        (folder / "out").mkdir(parents=True)
        for words in words_of(target, data, folder):
            assert quiet_call(words) in {0, 1, 2, 3}

    check()
