"""The container held against other libraries: `python -m tests.benchmark.container [--json] [--quick]`.

Ratios are of medians over interleaved rounds in one run, how often faster than the best or the named peer; the logs lie
in memory (/dev/shm) where there is such a place. Commands are whole processes, both with their modules compiled.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr
from dataclasses import replace
from io import BufferedReader, StringIO
from pathlib import Path
from statistics import median

import numpy as np
from mcap.writer import CompressionType
from mcap_landmarks.recording.opening import index_of
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import RawMessage

from tests.benchmark import container_columns as columns
from tests.benchmark import container_logs as logs
from tests.benchmark import container_peers as peers
from tests.benchmark import memory
from tests.benchmark.rewriting import rewriting_rows
from tests.benchmark.rows import Row, main

Run = Callable[[], object]
_MEMORY = Path("/dev/shm")  # noqa: S108 - logs in memory, so that no disk is measured
_SCRIPTS = Path(sys.executable).parent
_ROSBAGS = "rosbags-convert"


def measure(quick: bool) -> Iterator[Row]:
    """All rows; quick: of logs of a fifth of the size (to convert: of two fifths), in fewer rounds."""
    size, rounds = (1, 3) if quick else (5, 5)
    with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as name:
        folder = Path(name)
        yield from _reading(folder, size, rounds)
        yield from _columns(folder, size, rounds)
        yield from _parts(folder, size)
        yield from _converting(folder, max(size, 2), rounds)
        yield from rewriting_rows(logs.write_ours(folder / "edited.mcap", _mixed(max(size, 2))), rounds)
        yield from _help(folder, rounds)
    yield from memory.measure(quick)


def _reading(folder: Path, size: int, rounds: int) -> Iterator[Row]:
    images = logs.write_mcap(folder / "images.mcap", logs.images(300 * size), CompressionType.NONE)
    yield _read_row("read_images", images, rounds, 1.1)
    images.unlink()
    small = logs.by_time(logs.odometry(8000 * size), logs.transforms(8000 * size))
    path = logs.write_mcap(folder / "small.mcap", small, CompressionType.ZSTD)
    yield _read_row("read_small", path, rounds, 6)
    path.unlink()


def _read_row(name: str, path: Path, rounds: int, goal: float) -> Row:
    """Reading everything with CRCs; the value is how often faster than the mcap package, which checks none."""
    readers: Mapping[str, peers.Read] = {
        "ours": peers.read_ours,
        "mcap": peers.read_mcap,
        "mcap with CRCs": peers.read_mcap_with_crcs,
        "small-mcap with CRCs": peers.read_small_mcap,
        "rosbags": peers.read_rosbags,
    }
    counts = {read(path) for read in readers.values()}
    if len(counts) != 1:
        raise RuntimeError(f"the readers do not agree how many messages there are: {counts}")
    seconds = _interleaved({name: lambda read=read: read(path) for name, read in readers.items()}, rounds)
    return _ratio(name, seconds, "mcap", goal, counts.pop())


def _columns(folder: Path, size: int, rounds: int) -> Iterator[Row]:
    """Fields of all messages as arrays, ours with CRCs; the value is how often faster than the best of the others."""
    odometry = logs.write_mcap(folder / "odometry.mcap", logs.odometry(30_000 * size), CompressionType.ZSTD)
    yield _columns_row("columns_odometry", odometry, columns.odometry_readers(), min(rounds, 3))
    odometry.unlink()
    scans = logs.write_mcap(folder / "scans.mcap", logs.scans(3000 * size), CompressionType.ZSTD)
    yield _columns_row("columns_scan", scans, columns.scan_readers(), rounds)
    scans.unlink()


def _columns_row(name: str, path: Path, readers: Mapping[str, columns.Take], rounds: int) -> Row:
    arrays = [read(path) for read in readers.values()]
    if not all(np.array_equal(a, b) for found in arrays[1:] for a, b in zip(found, arrays[0], strict=True)):
        raise RuntimeError(f"{name}: the readers do not agree")
    count = len(arrays[0][0])
    del arrays
    seconds = _interleaved({key: lambda read=read: read(path) for key, read in readers.items()}, rounds)
    best = min((key for key in seconds if key != "ours"), key=lambda key: seconds[key])
    return _ratio(name, seconds, best, 10, count)


def _parts(folder: Path, size: int) -> Iterator[Row]:
    """Bytes that are read of a log of ours: of one topic, and of a stretch of time."""
    messages = logs.by_time(logs.odometry(1000 * size), logs.images(200 * size))
    path = logs.write_ours(folder / "ours.mcap", messages)
    whole, (first, last) = path.stat().st_size, (messages[0].log_time_ns, messages[-1].log_time_ns)
    share = 100 * _bytes_read(path, lambda log: list(log.messages(log.connections("/odom")))) / whole
    yield Row("topic_read", share, "% of the bytes", at_most=1, cases=whole)
    middle, tenth = (first + last) // 2, (last - first) // 10
    share = 100 * _bytes_read(path, lambda log: list(log.messages(None, middle, middle + tenth))) / whole
    touched = _touched(path, middle, middle + tenth)
    yield Row("time_range", share / touched, "of the bytes of the chunks it touches", at_most=1.05, cases=whole)
    path.unlink()


class _Counting(BufferedReader):
    """A file that counts what is read of it."""

    count = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.count += len(data)
        return data


def _bytes_read(path: Path, read: Callable[[Recording], object]) -> int:
    with _Counting(path.open("rb", buffering=0)) as stream:
        log = Recording(path, stream, index_of(path, stream, from_front=False), verify=True)
        read(log)
        return stream.count


def _touched(path: Path, start_ns: int, end_ns: int) -> float:
    """Percent of the bytes that the chunks of a stretch of time have, with what opening reads."""
    with _Counting(path.open("rb", buffering=0)) as stream:
        log = Recording(path, stream, index_of(path, stream, from_front=False), verify=True)
        return 100 * (stream.count + log.size_bytes(None, start_ns, end_ns)) / path.stat().st_size


def _mixed(size: int) -> list[RawMessage]:
    """What a robot records: 40 MB for each step in size, most of it images."""
    return logs.by_time(
        logs.odometry(6000 * size), logs.transforms(6000 * size), logs.scans(1200 * size), logs.images(160 * size)
    )


def _converting(folder: Path, size: int, rounds: int) -> Iterator[Row]:
    """Bags of both kinds to MCAP, by processes, each with what its defaults do: ours compresses all but images.

    `convert_db3_zstd` reads a bag whose messages are compressed one by one, which rosbags-convert reads, too; in
    `convert_db3_to_zstd` that compresses what it writes.
    """
    messages = _mixed(size)
    bag, db3 = logs.write_bag(folder / "log.bag", messages), logs.write_db3(folder / "db3", messages)
    zstd = logs.write_db3(folder / "zstd", messages, is_compressed=True)
    to_zstd = ("--compress", "zstd", "--compress-mode", "storage")
    sources: tuple[tuple[str, Path, tuple[str, ...], float | None], ...] = (
        ("convert_bag", bag, (), 1.0),
        ("convert_db3", db3, (), 1.0),
        ("convert_db3_zstd", zstd, (), 1.3),
        ("convert_db3_to_zstd", db3, to_zstd, None),
    )
    ours, theirs = folder / "ours.mcap", folder / "theirs"
    for name, source, options, goal in sources:
        commands = {
            "ours": ("mcap-landmarks", "convert", str(source), "-o", str(ours), "--overwrite"),
            _ROSBAGS: (_ROSBAGS, "--src", str(source), "--dst", str(theirs), "--dst-storage", "mcap", *options),
        }

        def run(command: tuple[str, ...]) -> None:
            shutil.rmtree(theirs, ignore_errors=True)
            ours.unlink(missing_ok=True)
            _process(folder, *command)

        seconds = _interleaved({key: lambda c=command: run(c) for key, command in commands.items()}, rounds)
        files = [source] if source.is_file() else list(source.iterdir())
        read = sum(file.stat().st_size for file in files)
        yield replace(_ratio(name, seconds, _ROSBAGS, goal, len(messages)), unit=f"x {_ROSBAGS} ({read / 1e6:.0f} MB)")


def _help(folder: Path, rounds: int) -> Iterator[Row]:
    for name, words in (("help", ("--help",)), ("help of a verb", ("convert", "--help"))):
        seconds = _interleaved({"ours": lambda words=words: _process(folder, "mcap-landmarks", *words)}, rounds)
        yield Row(name, seconds["ours"], "s", at_most=0.5)


def _process(folder: Path, *command: str) -> None:
    """Run a command of this environment; its modules stay compiled, as they are where it is installed."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    words = [str(_SCRIPTS / command[0]), *command[1:]]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr[-500:]}")


def _interleaved(runs: Mapping[str, Run], rounds: int) -> dict[str, float]:
    """Median seconds of each, after one run that warms up."""
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for turn in range(rounds + 1):
        for name, run in runs.items():
            start = time.perf_counter()
            with redirect_stderr(StringIO()):
                run()
            if turn:
                seconds[name].append(time.perf_counter() - start)
    return {name: median(values) for name, values in seconds.items()}


def _ratio(name: str, seconds: Mapping[str, float], peer: str, goal: float | None, cases: int) -> Row:
    """How often faster than a peer; the peers' values are how often faster than ours they are."""
    others = {key: seconds["ours"] / value for key, value in seconds.items() if key != "ours"}
    value = seconds[peer] / seconds["ours"]
    return Row(name, value, f"x {peer}", at_least=goal, cases=cases, peers=others)


if __name__ == "__main__":
    sys.exit(main(measure, "The container held against other libraries."))
