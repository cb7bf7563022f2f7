"""The diff finds what was planted, and nothing else."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks import channels
from mcap_landmarks.diff import logs as diff_logs
from mcap_landmarks.diff.comparison import diff
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, RawMessage, Stamped

from tests.diff.changes import CHANGES, SAME, replace, shifted
from tests.diff.recordings import localized_log, localized_messages, write
from tests.evaluation.runs import BUNDLES, FOREIGN, START_NS, STATUS, STEP_NS, Run, one_run


def compare(folder: Path, baseline: Run, candidate: Run, *tolerances: str) -> dict[str, Any]:
    """The diff; the two never lie in alike chunks, so that equal bytes are no way out."""
    found = diff(baseline.write(folder / "a.mcap"), candidate.write(folder / "b.mcap", "other"), tolerances)
    assert not found.losses
    assert not found.document["identical"]
    return found.document


def differing(document: dict[str, Any]) -> dict[str, Any]:
    return {
        name: channel
        for name, channel in document["channels"].items()
        if any(count[key] for count in (channel, channel["messages"]) for key in ("changed", "added", "removed"))
    }


def counts(channel: dict[str, Any]) -> tuple[int, int, int]:
    return channel["changed"], channel["added"], channel["removed"]


@settings(max_examples=8)
@given(st.integers(0, 10**6))
def test_a_run_is_the_same_as_itself(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    document = compare(tmp_path_factory.mktemp("same"), one_run(seed), one_run(seed))
    assert document["verdict"] == "same"
    assert not document["manifest"]
    assert not document["structure"]
    assert not differing(document)
    assert document["channels"]["/landmarks/detections"]["same"] == 3 * BUNDLES
    assert document["channels"]["/landmarks/pose"]["same"] == BUNDLES


@pytest.mark.parametrize("name", CHANGES)
def test_a_planted_change_is_found_and_nothing_else(name: str, tmp_path: Path) -> None:
    plant, channel, expected, fields = CHANGES[name]
    other = one_run()
    plant(other)
    document = compare(tmp_path, one_run(), other)
    assert document["verdict"] == "different"
    found = differing(document)
    assert set(found) == {channel.topic}
    assert counts(found[channel.topic]) == expected
    assert set(found[channel.topic]["fields"]) == fields
    lost = one_run().entries and len(other.entries) < len(one_run().entries)
    assert [row["what"] for row in document["structure"]] == ["messages"] * lost
    worst = found[channel.topic]["worst"]
    time_ns = (
        START_NS + (0 if channel in {FOREIGN, channels.MAP, channels.MAP_MARKERS, channels.MAP_PATH} else 2) * STEP_NS
    )
    assert worst
    assert {case["time_ns"] for case in worst} == {time_ns}


@pytest.mark.slow
@settings(max_examples=12)
@given(st.lists(st.sampled_from(sorted(CHANGES)), min_size=1, max_size=4, unique=True))
def test_swapped_sides_mirror_each_other(tmp_path_factory: pytest.TempPathFactory, names: list[str]) -> None:
    other = one_run()
    for name in names:
        CHANGES[name][0](other)
    folder = tmp_path_factory.mktemp("mirror")
    there, back = compare(folder, one_run(), other), compare(folder, other, one_run())
    assert set(differing(there)) == {CHANGES[name][1].topic for name in names}
    for topic, channel in there["channels"].items():
        mirrored = back["channels"][topic]
        for left, right in ((channel, mirrored), (channel["messages"], mirrored["messages"])):
            assert (left["same"], left["changed"]) == (right["same"], right["changed"])
            assert (left["added"], left["removed"]) == (right["removed"], right["added"])
        assert channel["fields"] == {name: turned_back(entry) for name, entry in mirrored["fields"].items()}


def turned_back(entry: dict[str, Any]) -> dict[str, Any]:
    ways = [{**way, "baseline": way["candidate"], "candidate": way["baseline"]} for way in entry["transitions"]]
    return {**entry, "transitions": ways}


@pytest.mark.parametrize("name", SAME)
def test_what_makes_no_difference(name: str, tmp_path: Path) -> None:
    other = one_run()
    SAME[name](other)
    assert compare(tmp_path, one_run(), other, "/scan.angle_min=1e-6")["verdict"] == "same"  # it is a float32


def test_tracks_that_swap_are_said_once(tmp_path: Path) -> None:
    other = one_run()
    for i in range(2, BUNDLES):
        other.edit("/landmarks/scene_objects", replace(ids=("t1", "t0", "t2", "t3")), i)
    channel = compare(tmp_path, one_run(), other)["channels"]["/landmarks/scene_objects"]
    assert counts(channel) == (2, 0, 0)
    assert {case["time_ns"] for case in channel["worst"]} == {START_NS + 2 * STEP_NS}


def test_tolerances_are_absolute_and_relative(tmp_path: Path) -> None:
    other = one_run()
    other.edit("/landmarks/pose", shifted("position_m", 0, 0.2))
    for value, verdict in (("0.1", "different"), ("0.21", "same"), ("1000%", "same"), ("0.1+0.001%", "different")):
        document = compare(tmp_path, one_run(), other, f"/landmarks/pose.position_m={value}")
        assert document["verdict"] == verdict, value


def test_a_manifest_is_what_was_meant_to_differ(tmp_path: Path) -> None:
    other = one_run()
    other.config = {"localize": {"max_sigma_m": 0.25, "new": True}}
    document = compare(tmp_path, one_run(), other)
    assert document["verdict"] == "same"
    assert document["manifest"] == [
        {"key": "config.localize.max_sigma_m", "baseline": 0.5, "candidate": 0.25},
        {"key": "config.localize.new", "baseline": None, "candidate": True},
    ]


def test_structure(tmp_path: Path) -> None:
    other = one_run()
    other.entries = [entry for entry in other.entries if entry[0] is not STATUS]
    other.note, other.verbatim = b"another", "edited"
    document = compare(tmp_path, one_run(), other)
    assert [(row["what"], row["name"]) for row in document["structure"]] == [
        ("channel", "/status"),
        ("metadata", "other.key"),
        ("attachment", "note.txt"),
    ]
    assert counts(document["channels"]["/status"]) == (0, 0, BUNDLES)


def test_a_topic_of_two_types_is_compared_by_its_bytes(tmp_path: Path) -> None:
    other = one_run()
    pose = PoseStamped.planar(START_NS, "map", [0, 0, 0])
    other.entries = [(e[0], e[1], pose) if e[0] is STATUS else e for e in other.entries]
    other.entries = [
        (dataclasses.replace(STATUS, message=PoseStamped), *e[1:]) if e[0] is STATUS else e for e in other.entries
    ]
    document = compare(tmp_path, one_run(), other)
    assert [row["what"] for row in document["structure"]] == ["type"]
    assert counts(document["channels"]["/status"]) == (BUNDLES, 0, 0)
    assert set(document["channels"]["/status"]["fields"]) == {"content"}


def test_an_image_that_one_camera_lost_is_its_own(tmp_path: Path) -> None:
    """Cameras that are triggered together have images of one time, and their boxes lie in one channel."""

    def seen(frame: str, left_px: float, stamp_ns: int) -> tuple[Channel, int, Detections]:
        box = np.array([[left_px, 10.0, left_px + 50.0, 90.0]])
        return channels.DETECTIONS, stamp_ns, Detections(stamp_ns, frame, ("",), ((("person", 0.8),),), box)

    content = [seen(frame, left, START_NS + i) for i in range(3) for frame, left in (("front", 10.0), ("rear", 300.0))]
    found = diff(write(tmp_path / "a.mcap", content), write(tmp_path / "b.mcap", [*content[:2], *content[3:]]))
    channel = found.document["channels"][channels.DETECTIONS.topic]
    assert counts(channel) == (0, 0, 1)
    assert channel["messages"] == {"same": 5, "changed": 0, "added": 0, "removed": 1}


def test_equal_files_are_not_read(tmp_path: Path) -> None:
    one, other = one_run().write(tmp_path / "a.mcap"), one_run().write(tmp_path / "b.mcap")
    found = diff(one, other)
    assert found.document["identical"]
    assert not found.fails
    assert found.document["channels"]["/landmarks/detections"]["same"] == BUNDLES


@pytest.mark.slow
@settings(max_examples=6)
@given(st.lists(st.sampled_from(sorted(CHANGES)), min_size=1, max_size=6, unique=True), st.integers(1, 4000))
def test_reading_in_parts_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], held_bytes: int
) -> None:
    other, folder = one_run(), tmp_path_factory.mktemp("parts")
    for name in names:
        CHANGES[name][0](other)
    whole = compare(folder, one_run(), other)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diff_logs, "HELD_BYTES", held_bytes)
        patch.setattr(diff_logs, "PARTNER_NS", STEP_NS // 2)
        assert compare(folder, one_run(), other) == whole


def test_a_message_that_cannot_be_decoded_is_compared_by_its_bytes(tmp_path: Path) -> None:
    data = [encode(PoseStamped.planar(START_NS + i, "map", [i, 0, 0])) for i in range(5)]
    moved = encode(PoseStamped.planar(START_NS + 3, "map", [7, 0, 0]))
    for name, changed in (("a", data[2:4]), ("b", [data[2][:40], moved])):
        with create_recording(tmp_path / f"{name}.mcap") as writer:
            connection = writer.connection(channels.POSE)
            for i, content in enumerate([*data[:2], *changed, data[4]]):
                writer.write(RawMessage(connection, START_NS + i, START_NS + i, i, content))
    channel = diff(tmp_path / "a.mcap", tmp_path / "b.mcap").document["channels"]["/landmarks/pose"]
    assert counts(channel) == (2, 0, 0)
    assert set(channel["fields"]) == {"content", "position_m"}
    assert channel["worst"][0]["candidate"].startswith("40 bytes, ")


def test_truth_may_come_from_elsewhere(tmp_path: Path) -> None:
    log = localized_log(tmp_path / "truth.mcap")
    blind = [entry for entry in localized_messages() if not entry[0].topic.startswith("/ground_truth/")]
    mine, theirs = write(tmp_path / "a.mcap", blind), write(tmp_path / "b.mcap", blind[:-2])
    assert not diff(mine, theirs).document["metrics"]
    metrics = diff(mine, theirs, reference=log).document["metrics"]
    assert metrics["scored"] == {"baseline": 3, "candidate": 2, "delta": -1}


def test_of_a_message_that_has_grown_the_fields_of_both_are_compared(tmp_path: Path) -> None:
    """Results from before conditions were written, and the same ones with them."""
    old = Path(__file__).parents[1] / "data" / "localize_without_conditions.mcap"
    changed = []
    with open_recording(old) as recording, create_recording(tmp_path / "new.mcap") as writer:
        for raw in recording.messages():
            if raw.connection.topic != channels.MATCH.topic:
                writer.write(raw)
                continue
            match = decode(LandmarkMatch, raw.data, raw.connection.schema.decode())
            asked = (Condition("objects", 6.0, 2.0, held=True),)
            match = dataclasses.replace(match, conditions=asked)
            if not changed:
                changed.append(raw.log_time_ns)
                match = dataclasses.replace(match, status=Status.AMBIGUOUS)
            writer.add(Stamped(channels.MATCH, raw.log_time_ns, match))
    for baseline, candidate, side in (("old", "new", "candidate"), ("new", "old", "baseline")):
        paths = {"old": old, "new": tmp_path / "new.mcap"}
        document = diff(paths[baseline], paths[candidate]).document
        assert [(row["what"], row["name"]) for row in document["structure"]] == [("definition", "/landmarks/match")]
        channel = document["channels"]["/landmarks/match"]
        assert counts(channel) == (1, 0, 0)
        assert set(channel["fields"]) == {"status"}
        assert channel["worst"][0][side] == "ambiguous"
