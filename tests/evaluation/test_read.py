"""What is evaluated, from files."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.channels import MAP_POSE, MATCH, POSE, SCENE_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import MapError, RecordingError
from mcap_landmarks.evaluation.metrics import evaluate, score
from mcap_landmarks.evaluation.read import read_reference, read_run
from mcap_landmarks.evaluation.thesis_results import results_of
from mcap_landmarks.evaluation.trajectory import interpolated
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, RawMessage

from tests.diff.recordings import START_NS, STEP_NS, localized_log, localized_messages, write
from tests.maps.examples import small_map

PAIRING = partial(interpolated, max_gap_ns=10**9)


def evaluated(path: Path) -> dict[str, Any]:
    outcome, reference, losses = read_run(path)
    assert losses == []
    return evaluate(outcome, reference, PAIRING)


def test_a_localized_log(tmp_path: Path) -> None:
    found = evaluated(localized_log(tmp_path / "r.mcap"))
    assert (found["bundles"], found["eligible"], found["localized"], found["scored"]) == (5, 4, 3, 3)
    assert found["statuses"] == {
        "localized": 3,
        "ambiguous": 1,
        "too_few_objects": 1,
        "no_match": 0,
        "inconsistent": 0,
        "weak_geometry": 0,
    }
    assert found["false"]["count"] == 1
    assert found["position"]["median_m"] == pytest.approx(0.1)
    assert found["nees"] == pytest.approx((1 + 0 + 1) / 3 / 3)
    assert found["map"]["matched"] == 3
    assert found["map"]["rmse_m"] == pytest.approx(0)


def test_a_position_without_heading_is_not_judged_by_one(tmp_path: Path) -> None:
    messages = [
        (channel, time_ns, replace(message, orientation_xyzw=np.zeros(4)) if channel == POSE else message)
        for channel, time_ns, message in localized_messages()
    ]
    assert sum(channel == POSE for channel, *_ in messages) == 3
    write(tmp_path / "r.mcap", messages)
    found = evaluated(tmp_path / "r.mcap")
    assert found["position"]["median_m"] == pytest.approx(0.1)
    assert found["heading"] == {"rmse_deg": None, "median_deg": None}


def test_a_mapped_log_is_judged_by_its_trajectory(tmp_path: Path) -> None:
    kept = [entry for entry in localized_messages() if entry[0] in {TRUTH_POSE, SCENE_OBJECTS}]
    shift = np.array([0.0, 0.5, 0.0])
    mapped = [
        (MAP_POSE, time_ns, PoseStamped.planar(time_ns, "map", message.pose + shift))
        for channel, time_ns, message in kept
        if isinstance(message, PoseStamped)
    ]
    found = evaluated(write(tmp_path / "m.mcap", kept + mapped))
    assert (found["bundles"], found["localized"], found["statuses"], found["nees"]) == (5, 5, None, None)
    assert found["position"]["rmse_m"] == pytest.approx(0.5)


def test_a_log_whose_every_match_failed_is_not_judged_by_its_mapping(tmp_path: Path) -> None:
    kept = [entry for entry in localized_messages() if entry[0] in {TRUTH_POSE, SCENE_OBJECTS}]
    failed = [(MATCH, time_ns, LandmarkMatch(time_ns, "base", Status.NO_MATCH)) for _, time_ns, _ in kept]
    mapped = [(MAP_POSE, time_ns, entry) for _, time_ns, entry in kept if isinstance(entry, PoseStamped)]
    found = evaluated(write(tmp_path / "m.mcap", kept + mapped + failed))
    assert (found["localized"], found["scored"], found["statuses"]["no_match"]) == (0, 0, 10)


def test_zero_stamps_count_by_log_time(tmp_path: Path) -> None:
    messages = [(channel, time_ns, replace(message, stamp_ns=0)) for channel, time_ns, message in localized_messages()]
    assert evaluated(write(tmp_path / "r.mcap", messages))["scored"] == 3


def test_objects_of_another_topic_count_and_empty_ids_are_no_identity(tmp_path: Path) -> None:
    tags = Channel("/tags", SceneObjects)
    messages = [
        (tags if channel == SCENE_OBJECTS else channel, time_ns, message)
        for channel, time_ns, message in localized_messages()
    ]
    nameless = [
        (channel, time_ns, replace(message, ids=("",) * len(message)) if isinstance(message, SceneObjects) else message)
        for channel, time_ns, message in messages
    ]
    assert evaluated(write(tmp_path / "a.mcap", messages))["eligible"] == 4
    assert evaluated(write(tmp_path / "b.mcap", nameless))["eligible"] == 4
    same = [
        entry if entry[0] != tags else (tags, entry[1], replace(entry[2], ids=("1",) * len(entry[2])))
        for entry in messages
    ]
    assert evaluated(write(tmp_path / "c.mcap", same))["eligible"] == 0


def test_a_map_is_judged_against_a_log(tmp_path: Path) -> None:
    write_map(tmp_path / "map.db", small_map())
    outcome, own, _ = read_run(tmp_path / "map.db")
    truth, _ = read_reference(localized_log(tmp_path / "r.mcap"))
    found: dict[str, Any] = evaluate(outcome, truth.over(own), PAIRING)
    assert (found["bundles"], found["localized"], found["scored"]) == (0, 0, 0)
    assert (found["map"]["landmarks"], found["map"]["reference"]) == (3, 3)


def test_a_map_is_known_by_its_content_too(tmp_path: Path) -> None:
    write_map(tmp_path / "map.sqlite", small_map())
    assert len(read_run(tmp_path / "map.sqlite")[0].landmarks or ()) == 3
    with pytest.raises(MapError, match="there is no such map"):
        read_run(tmp_path / "none.db")


def test_a_reference_of_either_kind(tmp_path: Path) -> None:
    (tmp_path / "t.tum").write_text("1 0 0 0 0 0 0 1\n")
    reference, losses = read_reference(tmp_path / "t.tum")
    assert (len(reference.trajectory or ()), reference.objects, losses) == (1, None, [])
    matches = [entry for entry in localized_messages() if entry[0] == MATCH]
    with pytest.raises(RecordingError, match="has neither /ground_truth/pose nor /ground_truth/objects"):
        read_reference(write(tmp_path / "bare.mcap", matches))


def test_results_are_told_as_the_thesis_does(tmp_path: Path) -> None:
    outcome, reference, _ = read_run(localized_log(tmp_path / "r.mcap"))
    results = results_of(outcome, score(outcome.trajectory, reference, PAIRING, aligned=False))
    assert results.classes == (("person", "suitcase"),) * 3
    np.testing.assert_allclose(results.estimate_xy[0] - results.reference_xy[0], [0.1, 0], atol=1e-9)
    bare, truth, _ = read_run(write(tmp_path / "n.mcap", localized_messages()))
    assert results_of(bare, score(bare.trajectory, truth, PAIRING, aligned=False)).classes == (("unknown",),) * 3


def test_a_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    odometry = Odometry.planar(START_NS, ("odom", "base_footprint"), np.zeros(3), np.eye(3))
    path = write(tmp_path / "o.mcap", [(Channel("/ground_truth/pose", Odometry), START_NS, odometry)])
    with pytest.raises(RecordingError, match="is nav_msgs/msg/Odometry instead of geometry_msgs/msg/PoseStamped"):
        read_run(path)


def test_numbers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    nowhere = PoseStamped.planar(START_NS, "map", [np.nan, 0, 0])
    with pytest.raises(RecordingError, match=r"/ground_truth/pose at 2023-11-14T22:13:20\.0{9}Z is not finite"):
        read_run(write(tmp_path / "n.mcap", [(TRUTH_POSE, START_NS, nowhere)]))


def test_a_message_that_cannot_be_read_is_a_loss(tmp_path: Path) -> None:
    path = tmp_path / "d.mcap"
    with create_recording(path) as writer:
        connection = writer.connection(MATCH)
        for i in range(2):
            writer.write(RawMessage(connection, START_NS + i * STEP_NS, START_NS, i, b"\0\1\0\0oops"))
    outcome, _, losses = read_run(path)
    assert losses == ["/landmarks/match: 2 messages could not be decoded"]
    assert outcome.bundles == 0


def test_a_log_from_before_conditions_were_written() -> None:
    """Its LandmarkMatch ends earlier than ours, and says so in its own definition."""
    outcome, _, losses = read_run(Path(__file__).parents[1] / "data" / "localize_without_conditions.mcap")
    assert losses == []
    assert (outcome.bundles, len(outcome.trajectory), len(outcome.seen)) == (9, 9, 9)
    assert outcome.statuses is not None
    assert outcome.statuses["localized"] == 9
