"""How fast recordings are edited by whole chunks, as a multiple of the mcap package's reading and writing anew."""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.output_formats import OutputForm
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.runs.topic_selection import Selection
from mcap_landmarks.stage import Connection, RawMessage

from tests.benchmark.rows import Row

MEMORY = Path("/dev/shm")  # noqa: S108 - a tmpfs, as the goal says: the disk is not what is measured
ROUNDS = 5
_GOAL = 7.0


def rewriting_rows(log: Path, rounds: int = ROUNDS) -> Iterator[Row]:
    """Append, cut, filter, merge and split of a log of ours, which should lie on a tmpfs.

    The filter leaves out the last topic by name, small messages in chunks that they share with others.
    """
    with open_recording(log) as recording:
        first, last = recording.start_ns or 0, recording.end_ns or 0
        topics = sorted(entry.connection.topic for entry in recording.channels)
    start, end = first + (last - first) // 4, last - (last - first) // 4
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as place:
        folder = Path(place)
        out, theirs = folder / "out.mcap", folder / "theirs.mcap"
        half = (folder / "a.mcap", folder / "b.mcap")
        for path, span in zip(half, ((None, start), (start, None)), strict=True):
            _convert([log], path, Selection((), *span))
        cases: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
            "append": (lambda: append(log, out), lambda: anew([log], theirs)),
            "cut": (lambda: _convert([log], out, Selection((), start, end)), lambda: anew([log], theirs, start, end)),
            "filter": (
                lambda: _convert([log], out, Selection(tuple(topics[:-1]))),
                lambda: anew([log], theirs, topics=topics[:-1]),
            ),
            "merge": (lambda: _convert(half, out, Selection()), lambda: anew(half, theirs)),
            "split": (
                lambda: convert(
                    [log],
                    folder / "parts",
                    Selection(),
                    {},
                    unwatched,
                    overwrite=True,
                    form=OutputForm(Split(duration_ns=max((last - first) // 4, 1))),
                ),
                lambda: anew([log], theirs),
            ),
        }
        for name, (ours, others) in cases.items():
            ratios, seconds = [], []
            for _ in range(rounds):
                mine, other = _seconds(ours), _seconds(others)
                ratios.append(other / mine)
                seconds.append(other)
            goal = _GOAL if name == "append" else None
            yield Row(name, statistics.median(ratios), "x", at_least=goal, cases=rounds, peers={"mcap": 1.0})


def append(log: Path, target: Path) -> None:
    """What a run does when it writes its output: the log as it is, and one channel more."""
    result = Connection("/result", "std_msgs/msg/UInt8", b"uint8 data", metadata={"offered_qos_profiles": ""})
    with open_recording(log) as recording, create_recording(target) as writer:
        every = [entry.connection for entry in recording.channels]
        kept = [connection for connection in every if writer.keep(connection, *recording.ids(connection))]
        for piece in recording.pieces(every, kept, writer.declared()):
            if isinstance(piece, WholeChunk):
                writer.copy(piece)
            else:
                writer.write(piece)
        for i in range(1000):
            writer.write(RawMessage(result, (recording.start_ns or 0) + i, 0, i, bytes([0, 1, 0, 0, i % 256])))


def anew(
    logs: Iterable[Path],
    target: Path,
    start_ns: int | None = None,
    end_ns: int | None = None,
    topics: list[str] | None = None,
) -> None:
    """The same with the mcap package: each message read and written, with its defaults."""
    with target.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "benchmark")
        ids: dict[str, int] = {}
        for log in logs:
            with log.open("rb") as source:
                for schema, channel, message in make_reader(source).iter_messages(topics, start_ns, end_ns):
                    if channel.topic not in ids:
                        schema_id = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
                        ids[channel.topic] = writer.register_channel(
                            channel.topic, channel.message_encoding, schema_id, channel.metadata
                        )
                    writer.add_message(
                        ids[channel.topic], message.log_time, message.data, message.publish_time, message.sequence
                    )
        writer.finish()


def _convert(logs: Iterable[Path], target: Path, selection: Selection) -> None:
    convert([*logs], target, selection, {}, unwatched, overwrite=True)


def _seconds(run: Callable[[], object]) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun
