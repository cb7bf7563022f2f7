"""`--time-offset` moves what one clock stamped, once, and results of another offset are not reused."""

from pathlib import Path

import pytest
from mcap_landmarks.channels import DETECTIONS, ODOMETRY, SCAN, SCAN_OBJECTS, SCENE_OBJECTS
from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.time_offsets import parse_offsets
from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request, choice_options

from tests.runs.chain import STEP_NS, raw_log, two_posts

FRONT = ["detect", "cluster", "fuse"]


def test_offsets_are_read_to_the_nanosecond() -> None:
    found = parse_offsets(["odometry=-0.497", "scan=+1700000000.123456789", "image=0"])
    assert found == {"odometry": -497_000_000, "scan": 1_700_000_000_123_456_789, "image": 0}


@pytest.mark.parametrize(
    ("texts", "complaint"),
    [
        (["odom=1"], "with a role of odometry, scan, second_scan, image, scene_objects"),
        (["odometry"], "give seconds, such as odometry=-0.5"),
        (["scan=soon"], "give seconds"),
        (["scan=nan"], "give seconds"),
        (["scan=inf"], "give seconds"),
        (["scan=1e30"], "give seconds"),
        (["scan=1", "scan=2"], "scan has an offset already"),
    ],
)
def test_offsets_that_cannot_be_read(texts: list[str], complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        parse_offsets(texts)


def test_a_stage_is_told_of_the_clocks_that_it_reads() -> None:
    choice = Choice(offsets_ns={"odometry": 5, "image": 7, "scan": 0})
    assert choice_options(choice, (DETECTIONS,)) == {"offsets_ns": {"image": 7}}
    assert choice_options(choice, (SCAN, ODOMETRY)) == {"offsets_ns": {"odometry": 5}}
    assert choice_options(choice, (SCAN,)) == {}


def test_stamps_are_corrected_once_and_images_keep_theirs(tmp_path: Path) -> None:
    log, model, out = raw_log(tmp_path / "log.mcap"), two_posts(tmp_path / "model.onnx"), tmp_path / "out.mcap"

    def run(**offsets_ns: int) -> LogRun:
        span = Span(Choice(offsets_ns=offsets_ns))
        return run_stages(Request(log, files={"model": model}, span=span), out, FRONT, "run")

    def states(run: LogRun) -> list[str]:
        return [stage.state for stage in run.stages]

    run()
    assert states(run(image=50_000_000)) == ["reused", "reused", "ran"]
    assert _first_stamps(out) == [STEP_NS, STEP_NS, STEP_NS]
    later = run(scan=50_000_000, image=0)
    assert {stage.stage: stage.state for stage in later.stages} == {"detect": "reused", "cluster": "ran", "fuse": "ran"}
    assert _first_stamps(out) == [STEP_NS, STEP_NS + 50_000_000, STEP_NS + 50_000_000]
    assert states(run(scan=50_000_000)) == ["reused", "reused", "reused"]


def _first_stamps(path: Path) -> list[int]:
    """Of detections, scan objects and scene objects."""
    found = []
    with open_recording(path) as recording:
        for channel in (DETECTIONS, SCAN_OBJECTS, SCENE_OBJECTS):
            entries = [entry.connection for entry in recording.channels if entry.connection.topic == channel.topic]
            found.append(decode(channel.message, next(recording.messages(entries)).data).stamp_ns)
    return found
