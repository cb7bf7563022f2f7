"""Options as the command line and Python give them: what goes together, and what it means."""

from pathlib import Path

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.run_options import RunOptions

LOG = Path("log.mcap")


def request(options: RunOptions) -> Request:
    (found,) = options.requests([LOG])
    return found


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (RunOptions(scan=["/a"], scan_from="/b"), "--scan-from takes the place of --scan"),
        (RunOptions(scan=["/a", "/b", "/c"]), "--scan /a /b /c: two are the most"),
        (RunOptions(image=["all", "/a"]), "--image all takes every camera"),
        (RunOptions(start="noon"), "--start noon: give RFC 3339"),
        (RunOptions(heights="0.3:0.1"), "give two heights in metres"),
        (RunOptions(heights="0.3"), "give two heights in metres"),
        (RunOptions(heights="a:b"), "give two heights in metres"),
    ],
)
def test_what_does_not_go_together_is_refused(options: RunOptions, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        request(options)


def test_a_slice_is_a_setting() -> None:
    assert request(RunOptions(heights="-0.1:0.25")).settings == {"cluster": {"slice_m": [-0.1, 0.25]}}
    assert request(RunOptions()).settings == {}


def test_topics_are_of_roles() -> None:
    choice = request(RunOptions(odom="/o", image=["/left"], scan=["/a", "/b"], remap=["/x=/y"])).span.choice
    assert choice.topics == {"odometry": "/o", "image": "/left", "scan": "/a", "second_scan": "/b"}
    assert choice.remaps == {"/x": "/y"}
    assert request(RunOptions(image=["/left", "/right", "/left"])).span.choice.images == ("/left", "/right")
    assert request(RunOptions(scan_from="/points")).span.choice.topics == {"scan": "/points"}


def test_there_is_a_log() -> None:
    with pytest.raises(UsageError, match="no log is named; name at least one"):
        RunOptions().requests([])
