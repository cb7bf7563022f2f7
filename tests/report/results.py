"""A small whole result: the first ten seconds of the demo's log, with what localize found in them."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from mcap_landmarks.channels import TF
from mcap_landmarks.manifest import CONTENT, RUN
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Connection, RawMessage

from tests.golden.test_golden import GOLDEN, START_NS

END_NS = START_NS + 10 * 10**9


def whole_result(path: Path) -> Path:
    """Write it: the messages of the log and the golden results, with the manifest of these; no detector has to run."""
    with (
        open_recording(resource("recordings", "demo_localize.mcap")) as log,
        open_recording(GOLDEN / "localize.mcap") as results,
        create_recording(path) as writer,
    ):
        writer.metadata[RUN] = {
            name: text for name, text in results.metadata[RUN].items() if name not in {CONTENT, "fingerprint"}
        }
        transforms = _transforms(log)
        for raw in sorted(chain(_part(log), _part(results)), key=lambda raw: raw.log_time_ns):
            writer.write(raw._replace(connection=transforms) if raw.connection.topic == TF.topic else raw)
    return path


def _part(recording: Recording) -> Iterator[RawMessage]:
    return recording.messages(None, START_NS, END_NS)


def _transforms(log: Recording) -> Connection:
    (connection,) = log.connections(TF.topic)
    return connection
