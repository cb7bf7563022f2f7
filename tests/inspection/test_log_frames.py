"""Frames of a whole log: transforms whenever they came, several parents, and frames that are not a topic's own."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import TF, TF_STATIC
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.log_frames import LogFrames, frames_of, is_robot
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Stamped

from tests.cli.logs import write

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


def mount(parent: str, child: str, x_m: float, turn: np.ndarray = LEVEL) -> Transform:
    return Transform(0, parent, child, np.array([x_m, 0.0, 0.0]), turn)


def frames(path: Path, *messages: Stamped) -> LogFrames:
    with open_recording(write(path, list(messages))) as recording:
        return frames_of(recording)


def test_transforms_hold_for_the_whole_log_and_static_ones_win(tmp_path: Path) -> None:
    found = frames(
        tmp_path / "log.mcap",
        Stamped(TF, 1, TFMessage((mount("base_link", "laser", 9.0), mount("base_link", "arm", 2.0)))),
        Stamped(TF_STATIC, 5, TFMessage((mount("base_link", "laser", 1.0),))),
    )
    assert found.base_from("base_link", "/laser", "scans are")[0, 3] == 1.0
    assert found.base_from("base_link", "arm", "scans are")[0, 3] == 2.0
    assert not found.parents


def test_a_frame_with_two_parents_is_told_and_one_without_a_rotation_is_none(tmp_path: Path) -> None:
    steps = mount("base_link", "laser", 1.0), mount("mast", "laser", 2.0), mount("base_link", "eye", 3.0, np.zeros(4))
    found = frames(tmp_path / "log.mcap", Stamped(TF_STATIC, 1, TFMessage(steps)))
    assert found.parents == {"laser": ("base_link", "mast")}
    assert "eye" not in found.tree


def test_what_is_not_connected_is_refused_by_name_but_for_names_of_the_robot(tmp_path: Path) -> None:
    found = frames(tmp_path / "log.mcap", Stamped(TF_STATIC, 1, TFMessage((mount("base_link", "laser", 1.0),))))
    np.testing.assert_array_equal(found.base_from("base_link", "robot_footprint", "objects are"), np.eye(4))
    with pytest.raises(RecordingError, match="objects are in the frame mast, and no transforms lead"):
        found.base_from("base_link", "mast", "objects are")


@pytest.mark.parametrize(
    ("counts", "foreign"),
    [
        ({"laser": 100}, set()),
        ({"laser": 9, "": 1, "other_link": 1}, {"", "other_link"}),
        ({"laser": 100, "arm": 4}, {"arm"}),
        ({"laser": 100, "arm": 40}, set()),  # two LiDARs by turns
        ({"lidar": 9, "mast": 3}, set()),  # nothing tells where either is
        ({}, set()),
    ],
)
def test_few_messages_of_another_frame_are_not_a_topics_own(
    tmp_path: Path, counts: dict[str, int], foreign: set[str]
) -> None:
    steps = mount("base_link", "laser", 1.0), mount("base_link", "arm", 2.0)
    found = frames(tmp_path / "log.mcap", Stamped(TF_STATIC, 1, TFMessage(steps)))
    assert found.foreign("base_link", counts) == foreign


@pytest.mark.parametrize(
    ("name", "expected"), [("", True), ("base_link", True), ("tug/base_link", True), ("robot1", True), ("laser", False)]
)
def test_names_of_the_robot(name: str, expected: bool) -> None:
    assert is_robot(name) is expected


def test_frames_that_move_against_the_robot_or_have_no_rotation_are_refused_as_such(tmp_path: Path) -> None:
    found = frames(
        tmp_path / "log.mcap",
        Stamped(TF_STATIC, 1, TFMessage((mount("base_link", "eye", 1.0, np.zeros(4)),))),
        Stamped(TF, 2, TFMessage((mount("odom", "base_link", 0.0), mount("base_link", "arm", 1.0)))),
        Stamped(TF, 3, TFMessage((mount("odom", "base_link", 0.5), mount("base_link", "arm", 2.0)))),
    )
    for name in ("odom", "arm"):
        with pytest.raises(RecordingError, match=f"in the frame {name}, which moves against the robot"):
            found.base_from("base_link", name, "objects are")
    with pytest.raises(RecordingError, match="whose transform has a quaternion of zeros"):
        found.base_from("base_link", "eye", "objects are")
    assert not found.circle


def test_transforms_that_go_round_are_told(tmp_path: Path) -> None:
    steps = mount("base_link", "mast", 1.0), mount("mast", "eye", 1.0), mount("eye", "base_link", 1.0)
    found = frames(tmp_path / "log.mcap", Stamped(TF_STATIC, 1, TFMessage(steps)))
    assert set(found.circle) == {"base_link", "mast", "eye"}
