"""Several recordings, or parts of them, read as one."""

from pathlib import Path

from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY, SCAN
from mcap_landmarks.recording.layered_log import Layer, LayeredLog
from mcap_landmarks.recording.reader import open_recording

from tests.cli.logs import write
from tests.runs.chain import COUNT, STEP_NS, raw_messages


def test_layers_come_in_order_and_are_read_by_need(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", raw_messages())
    with open_recording(path) as one, open_recording(path) as other:
        pick = {entry.connection.topic: entry for entry in one.channels}
        again = {entry.connection.topic: entry for entry in other.channels}
        view = LayeredLog(
            path, [Layer(one, (pick[SCAN.topic], pick[ODOMETRY.topic])), Layer(other, (again[CAMERA_IMAGE.topic],))]
        )
        read: list[int] = []
        found = [(raw.log_time_ns, raw.connection.topic) for raw in view.messages(progress=read.append)]
        assert len(found) == 3 * COUNT
        assert [time for time, _ in found] == sorted(time for time, _ in found)
        assert [topic for _, topic in found[:3]] == [ODOMETRY.topic, SCAN.topic, CAMERA_IMAGE.topic]
        assert sum(read) == view.size_bytes() == one.size_bytes()
        scans = [pick[SCAN.topic].connection]
        assert view.size_bytes(scans) < view.size_bytes()
        assert {raw.connection.topic for raw in view.messages(scans)} == {SCAN.topic}
        assert len(list(view.messages(None, 2 * STEP_NS, 4 * STEP_NS))) == 3 * 2


def test_chunks_without_a_wanted_channel_are_not_read(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", raw_messages())
    data = bytearray(path.read_bytes())
    picture = data.find(b"\xff\xd8\xff")
    data[picture + 20] ^= 1
    path.write_bytes(data)
    with open_recording(path) as recording:
        scans = recording.connections(SCAN.topic)
        assert len(list(recording.messages(scans))) == COUNT
        assert recording.losses == []
        assert len(list(recording.messages(recording.connections(CAMERA_IMAGE.topic)))) == 0
        assert len(recording.losses) == 1
