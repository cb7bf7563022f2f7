"""The diff finds what was planted, and nothing else."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from tests.compare.runs import BUNDLES, FOREIGN, START_NS, STATUS, STEP_NS, Row, Run, one_run, with_row, without
from toolkit import channels
from toolkit.compare.diff import diff
from toolkit.messages.codec import M
from toolkit.messages.match import Status
from toolkit.messages.poses import PoseStamped
from toolkit.stage import Channel

DETECTION = ("ids", "hypotheses", "boxes_xyxy")
OBJECT = ("ids", "hypotheses", "positions_xy", "covariances", "radii_m")
Plant = Callable[[Run], None]


def edit(channel: Channel[M], change: Callable[[Any], M], number: int = 2) -> Plant:
    return lambda run: run.edit(channel.topic, change, number)


def drop(channel: Channel[M], number: int = 2) -> Plant:
    return lambda run: run.entries.pop(run.index(channel.topic, number)) and None


def replace(**fields: object) -> Callable[[M], M]:
    return lambda message: dataclasses.replace(message, **fields)


def shifted(name: str, row: Row, by: ArrayLike) -> Callable[[M], M]:
    return lambda message: with_row(message, name, row, getattr(message, name)[row] + by)


def late(run: Run) -> None:
    i = run.index(channels.POSE.topic, 2)
    channel, time_ns, message = run.entries[i]
    run.entries[i] = channel, time_ns + 5_000_000, message


# what was done, to which topic, counts (changed, added, removed), fields
CHANGES = {
    "detection gone": (
        edit(channels.DETECTIONS, lambda m: without(m, 0, DETECTION)), channels.DETECTIONS, (0, 0, 1), set()),
    "box moved": (
        edit(channels.DETECTIONS, shifted("boxes_xyxy", 1, 9.0)), channels.DETECTIONS, (1, 0, 0), {"box_xyxy_px"}),
    "box elsewhere": (
        edit(channels.DETECTIONS, shifted("boxes_xyxy", 1, 900.0)), channels.DETECTIONS, (0, 1, 1), set()),
    "another class": (
        edit(channels.DETECTIONS, lambda m: with_row(m, "hypotheses", 2, (("bench", 0.7),))),
        channels.DETECTIONS, (1, 0, 0), {"class"}),
    "another score": (
        edit(channels.DETECTIONS, lambda m: with_row(m, "hypotheses", 2, (("person", 0.6),))),
        channels.DETECTIONS, (1, 0, 0), {"score"}),
    "outline": (
        edit(channels.ANNOTATIONS, lambda m: without(m, 0, ("outlines",))), channels.ANNOTATIONS, (1, 0, 0),
        {"points"}),
    "object gone": (
        edit(channels.SCENE_OBJECTS, lambda m: without(m, 1, OBJECT)), channels.SCENE_OBJECTS, (0, 0, 1), set()),
    "object moved": (
        edit(channels.SCENE_OBJECTS, shifted("positions_xy", 3, [0.3, -0.1])), channels.SCENE_OBJECTS, (1, 0, 0),
        {"position_m", "others.position_m"}),
    "covariance": (
        edit(channels.SCENE_OBJECTS, shifted("covariances", (0, 1, 1), 0.01)), channels.SCENE_OBJECTS, (1, 0, 0),
        {"covariance", "others.covariance"}),
    "radius": (
        edit(channels.SCENE_OBJECTS, shifted("radii_m", 2, 0.1)), channels.SCENE_OBJECTS, (1, 0, 0), {"size_m"}),
    "track": (
        edit(channels.SCENE_OBJECTS, lambda m: with_row(m, "ids", 2, "t9")), channels.SCENE_OBJECTS, (1, 0, 0), {"id"}),
    "fewer hypotheses": (
        edit(channels.SCENE_OBJECTS, lambda m: with_row(m, "hypotheses", 0, m.hypotheses[0][:1])),
        channels.SCENE_OBJECTS, (1, 0, 0), {"others"}),
    "frame": (
        edit(channels.SCENE_OBJECTS, replace(frame_id="base_link")), channels.SCENE_OBJECTS, (4, 0, 0),
        {"frame_id", "message.frame_id"}),
    "status": (edit(channels.MATCH, replace(status=Status.AMBIGUOUS)), channels.MATCH, (1, 0, 0), {"status"}),
    "residual": (edit(channels.MATCH, shifted("residual_m", 1, 0.1)), channels.MATCH, (1, 0, 0), {"residual_m"}),
    "landmark": (
        edit(channels.MATCH, lambda m: with_row(m, "landmark_ids", 0, "l9")), channels.MATCH, (1, 0, 0),
        {"landmark_ids"}),
    "position": (edit(channels.POSE, shifted("position_m", 0, 0.2)), channels.POSE, (1, 0, 0), {"position_m"}),
    "no number": (edit(channels.POSE, shifted("position_m", 0, np.nan)), channels.POSE, (1, 0, 0), {"position_m"}),
    "heading": (
        edit(channels.POSE, lambda m: PoseStamped.planar(m.stamp_ns, "map", [*m.pose[:2], m.pose[2] + 0.1])),
        channels.POSE, (1, 0, 0), {"orientation"}),
    "pose gone": (drop(channels.POSE), channels.POSE, (0, 0, 1), set()),
    "pose late": (late, channels.POSE, (1, 0, 0), {"log_time_ns"}),
    "variance": (
        edit(channels.POSE_COVARIANCE, shifted("covariance", (5, 5), 1.0)), channels.POSE_COVARIANCE, (1, 0, 0),
        {"covariance"}),
    "transform": (
        edit(channels.TF, lambda m: dataclasses.replace(
            m, transforms=(shifted("translation_m", 1, 0.5)(m.transforms[0]),))),
        channels.TF, (1, 0, 0), {"translation_m"}),
    "transform of another": (
        edit(channels.TF, lambda m: dataclasses.replace(
            m, transforms=(dataclasses.replace(m.transforms[0], child_frame_id="other"),))),
        channels.TF, (0, 1, 1), set()),
    "path": (edit(channels.MAP_PATH, lambda m: without(m, 4, ("poses",)), 0), channels.MAP_PATH, (0, 0, 1), set()),
    "marker": (
        edit(channels.MAP_MARKERS, lambda m: dataclasses.replace(
            m, markers=(m.markers[0], dataclasses.replace(m.markers[1], text="chair"))), 0),
        channels.MAP_MARKERS, (1, 0, 0), {"text"}),
    "landmark moved": (
        edit(channels.MAP, shifted("positions_xy", 2, 0.25), 0), channels.MAP, (1, 0, 0),
        {"position_m", "others.position_m"}),
    "speed": (
        edit(channels.ODOMETRY, shifted("linear_mps", 0, 0.1)), channels.ODOMETRY, (1, 0, 0), {"twist.twist.linear"}),
    "range": (edit(channels.SCAN, shifted("ranges_m", 7, 0.1)), channels.SCAN, (1, 0, 0), {"ranges"}),
    "beam lost": (edit(channels.SCAN, lambda m: with_row(m, "ranges_m", 7, np.inf)), channels.SCAN, (1, 0, 0),
                  {"ranges"}),
    "image": (edit(channels.CAMERA_IMAGE, replace(data=b"other")), channels.CAMERA_IMAGE, (1, 0, 0), {"content"}),
    "number": (edit(STATUS, replace(data=77)), STATUS, (1, 0, 0), {"data"}),
    "foreign": (lambda run: run.foreign.update({START_NS: b"other"}), FOREIGN, (1, 0, 0), {"content"}),
}  # fmt: skip


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


def turned(message: PoseStamped) -> PoseStamped:
    return dataclasses.replace(message, orientation_xyzw=-message.orientation_xyzw)


SAME = {
    "sign of a quaternion": edit(channels.POSE, turned),
    "angle a turn on": edit(channels.SCAN, lambda m: replace(angle_min_rad=m.angle_min_rad + 2 * np.pi)(m)),
    "order of detections": edit(
        channels.DETECTIONS,
        lambda m: dataclasses.replace(m, hypotheses=m.hypotheses[::-1], boxes_xyxy=m.boxes_xyxy[::-1]),
    ),
    "rounding of a box": edit(channels.DETECTIONS, shifted("boxes_xyxy", 1, 0.25)),
    "rounding of a position": edit(channels.POSE, shifted("position_m", 0, 5e-7)),
    "other names of tracks": lambda run: [
        run.edit("/landmarks/scene_objects", replace(ids=("a", "b", "c", "d")), i) for i in range(BUNDLES)
    ],
}


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


def test_equal_files_are_not_read(tmp_path: Path) -> None:
    one, other = one_run().write(tmp_path / "a.mcap"), one_run().write(tmp_path / "b.mcap")
    found = diff(one, other)
    assert found.document["identical"]
    assert not found.fails
    assert found.document["channels"]["/landmarks/detections"]["same"] == BUNDLES
