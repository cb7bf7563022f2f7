"""Changes to plant in a run, and what the diff should say of each."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from mcap_landmarks import channels
from mcap_landmarks.messages.codec import M
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.stage import Channel
from numpy.typing import ArrayLike

from tests.evaluation.runs import ACCIDENTAL, BUNDLES, FOREIGN, START_NS, STATUS, Row, Run, with_row, without

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
    "accidents": (
        edit(channels.MATCH, replace(expected_accidental=1.01 * ACCIDENTAL)), channels.MATCH, (1, 0, 0),
        {"expected_accidental"}),
    "condition": (
        edit(channels.MATCH, lambda m: with_row(m, "conditions", 0, m.conditions[0]._replace(value=1.0, held=False))),
        channels.MATCH, (1, 0, 0), {"condition_values", "condition_held"}),
    "limit": (
        edit(channels.MATCH, lambda m: with_row(m, "conditions", 1, m.conditions[1]._replace(limit=2.1e-3))),
        channels.MATCH, (1, 0, 0), {"condition_limits"}),
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
    "rounding of odds": edit(channels.MATCH, replace(expected_accidental=(1 + 1e-4) * ACCIDENTAL)),
    "rounding of a position": edit(channels.POSE, shifted("position_m", 0, 5e-7)),
    "other names of tracks": lambda run: [
        run.edit("/landmarks/scene_objects", replace(ids=("a", "b", "c", "d")), i) for i in range(BUNDLES)
    ],
}
