"""What damaged recordings give: ours (`recover`) beside the mcap package, small-mcap and pymcap-cli.

python -m tests.benchmark.robustness [--json] [--quick]

Each damage of `tests.recording.damages` is done to one recording of 1,080 messages that the mcap package wrote; with
--quick every third. Three rows for each: sound messages that arrived, payloads that were never recorded, and the exit
code (of readers 1 for an exception). The judge is the mcap package: messages count by topic, sequence, time and bytes.
"""

import contextlib
import io
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import small_mcap
from mcap.reader import make_reader
from mcap_landmarks.cli.main import run

from tests.benchmark.rows import Row, main
from tests.recording.damages import DAMAGES, Truth, write

_NOTHING = {"0 bytes", "magic only", "not an MCAP"}
_LOSSLESS = {"whole", "no summary", "wrong summary offset", "garbage after the footer", "statistics", "message index"}
_CONTRADICTED = {"chunk CRC"}
"""Rows whose messages are all there while their CRC says otherwise: only what checks CRCs competes."""
_CHECKING = {"mcap with CRC", "small-mcap with CRC"}
_NO_CRC = {"flipped, no CRC"}
"""Rows in which nothing can tell that a payload is wrong: it may be passed on, named as unverified."""


class Outcome(NamedTuple):
    """How a tool ended, and the messages that it gave."""

    code: int
    messages: Counter[Truth]


def measure(quick: bool) -> Iterator[Row]:
    """The matrix, row by row."""
    with tempfile.TemporaryDirectory() as name:
        for damage in list(DAMAGES)[:: 3 if quick else 1]:
            yield from _rows(damage, Path(name))


def _rows(damage: str, folder: Path) -> Iterator[Row]:
    how, change = DAMAGES[damage]
    data, sound = write(**how)  # type: ignore[arg-type]
    log = folder / "log.mcap"
    log.write_bytes(change(data))
    truth = Counter(sound)
    ours = _ours(log, folder / "ours.mcap")
    peers = {peer: tool(log, folder / "peer.mcap") for peer, tool in _PEERS.items()}
    good = {peer: (one.messages & truth).total() for peer, one in peers.items()}
    wrong = {peer: (one.messages - truth).total() for peer, one in peers.items()}
    rivals = _CHECKING if damage in _CONTRADICTED else {peer for peer in peers if not wrong[peer]}
    best = 0 if damage in _NOTHING else max((good[peer] for peer in rivals), default=0)
    found = (ours.messages & truth).total()
    yield Row(damage, found, "messages", at_least=best, cases=len(sound), peers=dict(good))
    most = None if damage in _NO_CRC else 0
    yield Row(f"{damage}: wrong", (ours.messages - truth).total(), "messages", at_most=most, peers=dict(wrong))
    code = _code(damage, found, len(sound))
    codes = {peer: float(one.code) for peer, one in peers.items()}
    yield Row(f"{damage}: exit", ours.code, "", at_least=code[0], at_most=code[1], peers=codes)


def _code(damage: str, found: int, sound: int) -> tuple[int, int]:
    """The exit codes that are right: 3 where messages are lost, 0 or 3 where at most another record is."""
    if damage in _NOTHING:
        return 1, 1
    if damage in _LOSSLESS | _NO_CRC:
        return 0, 0
    return (3, 3) if found < sound else (0, 3)


def _ours(log: Path, out: Path) -> Outcome:
    out.unlink(missing_ok=True)
    code = 0
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            run(["recover", str(log), "-o", str(out)])
        except SystemExit as stop:
            code = int(stop.code or 0)
    return Outcome(code, _judged(out))


def _judged(out: Path) -> Counter[Truth]:
    """The messages of a tool's output."""
    return _mcap(out, validate=False).messages if out.exists() else Counter()


def _mcap(log: Path, *, validate: bool) -> Outcome:
    def messages() -> Iterator[Truth]:
        with log.open("rb") as stream:
            for _, channel, message in make_reader(stream, validate_crcs=validate).iter_messages():
                yield channel.topic, message.sequence, message.log_time, message.data

    return _read(messages())


def _small(log: Path, *, validate: bool) -> Outcome:
    def messages() -> Iterator[Truth]:
        with log.open("rb") as stream:
            for _, channel, message in small_mcap.read_message(stream, validate_crc=validate):
                yield channel.topic, message.sequence, message.log_time, bytes(message.data)

    return _read(messages())


def _read(messages: Iterator[Truth]) -> Outcome:
    """What a reader gives until it ends or fails."""
    found: Counter[Truth] = Counter()
    try:
        for message in messages:
            found[message] += 1
    except Exception:  # noqa: BLE001 - whatever a peer raises is its answer
        return Outcome(1, found)
    return Outcome(0, found)


def _pymcap(log: Path, out: Path) -> Outcome:
    out.unlink(missing_ok=True)
    program = "from pymcap_cli.cli import main; main()"
    command = [sys.executable, "-c", program, "recover", str(log), "-o", str(out), "--force"]
    done = subprocess.run(command, capture_output=True, check=False, timeout=120)
    return Outcome(done.returncode, _judged(out))


_PEERS: dict[str, Callable[[Path, Path], Outcome]] = {
    "mcap": lambda log, _out: _mcap(log, validate=False),
    "mcap with CRC": lambda log, _out: _mcap(log, validate=True),
    "small-mcap": lambda log, _out: _small(log, validate=False),
    "small-mcap with CRC": lambda log, _out: _small(log, validate=True),
    "pymcap-cli recover": _pymcap,
}


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
