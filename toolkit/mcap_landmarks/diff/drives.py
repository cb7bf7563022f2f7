"""The diff of two drives: not message by message, but by rates, distributions, classes, landmarks and errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.diff.conditions import FailCondition
from mcap_landmarks.diff.criteria import METRICS
from mcap_landmarks.diff.declared import manifest_rows
from mcap_landmarks.diff.document import MetricEntry
from mcap_landmarks.diff.drive_document import (
    ClassEntry,
    DriveDocument,
    DriveEntry,
    LandmarkEntry,
    LandmarksEntry,
    TopicEntry,
)
from mcap_landmarks.diff.drive_topics import DriveTopic, class_rates, distances, rates, read_topics
from mcap_landmarks.diff.log_figures import ReadLog, log_figures, read_log
from mcap_landmarks.diff.metric_rows import side_by_side
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.landmark_metrics import associate
from mcap_landmarks.evaluation.metrics import Reference, RunResult
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording, open_recording

_STEP_NS = 500_000_000
"""Odometry is followed in steps of this: at its own rate its noise would add to the way."""


@dataclass(frozen=True, slots=True, eq=False)
class _Drive:
    """One drive as it is compared: `log` is None where it has no results."""

    entry: DriveEntry
    topics: Mapping[str, DriveTopic]
    manifest: Mapping[str, str]
    log: ReadLog | None
    losses: tuple[str, ...]

    @property
    def run(self) -> RunResult | None:
        """What the drive gave."""
        return None if self.log is None else self.log.run


@dataclass(frozen=True, slots=True)
class DriveDiff:
    """The document of `diff --json` of two drives, and what could not be read."""

    document: DriveDocument
    losses: list[str]

    @property
    def fails(self) -> bool:
        """Whether a condition holds, or, as two drives are never the same, none was asked for."""
        conditions = self.document["conditions"]
        return any(entry["holds"] for entry in conditions) if conditions else True


def diff_drives(
    baseline: Location,
    candidate: Location,
    conditions: Sequence[FailCondition] = (),
    *,
    reference: Location | None = None,
    progress: Progress | None = None,
) -> DriveDiff:
    """How two drives differ, each measured against its own truth, or that of `reference`.

    Raises:
        ToolkitError: a file cannot be read, or a condition is wrong.
    """
    known, lost = read_reference(reference) if reference else (Reference(), [])
    mine, theirs = _read(baseline, progress), _read(candidate, progress)
    shared = [topic for topic in mine.topics if topic in theirs.topics]
    document: DriveDocument = {
        "verdict": "two drives",
        "baseline": mine.entry,
        "candidate": theirs.entry,
        "manifest": manifest_rows(mine.manifest, theirs.manifest),
        "channels": {topic: _topic(topic, mine, theirs) for topic in sorted({*mine.topics, *theirs.topics})},
        "fields": {topic: distances(mine.topics[topic], theirs.topics[topic]) for topic in shared},
        "statuses": _statuses(mine.run, theirs.run),
        "classes": {topic: found for topic in shared if (found := _classes(topic, mine, theirs))},
        "landmarks": _landmarks(mine.run, theirs.run),
        "metrics": _metrics(mine.log, theirs.log, known),
        "conditions": [],
    }
    if conditions:
        figures = drive_figures(document)
        document["conditions"] = [
            {"condition": condition.text, "value": condition.value(figures), "holds": condition.holds(figures)}
            for condition in conditions
        ]
    return DriveDiff(document, list(dict.fromkeys([*mine.losses, *theirs.losses, *lost])))


def drive_figures(document: DriveDocument) -> dict[str, float | None]:
    """Everything that a condition may name: the candidate's metrics, `baseline.` and `delta.`, landmarks, distances."""
    landmarks = document["landmarks"]
    found: dict[str, float | None] = {
        "landmarks.came": None if landmarks is None else len(landmarks["came"]),
        "landmarks.went": None if landmarks is None else len(landmarks["went"]),
    }
    for name in METRICS:
        entry = document["metrics"].get(name, {"baseline": None, "candidate": None, "delta": None})
        found[name], found[f"baseline.{name}"] = entry["candidate"], entry["baseline"]
        found[f"delta.{name}"] = entry["delta"]
    for topic, channel in document["channels"].items():
        if channel["candidate"] is not None:
            found[f"channels.{topic}.rate_hz"] = channel["candidate"]["rate_hz"]
            found[f"channels.{topic}.gaps"] = channel["candidate"]["gaps"]
    for topic, fields in document["fields"].items():
        found |= {f"channels.{topic}.fields.{name}.distance": entry["distance"] for name, entry in fields.items()}
    return found


def _read(path: Location, progress: Progress | None) -> _Drive:
    try:
        log = read_log(path)
    except RecordingError:  # of sensors alone, or of results that cannot be evaluated
        log = None
    with open_recording(path) as recording:
        topics = read_topics(recording, progress)
        entry: DriveEntry = {
            "start_ns": recording.start_ns,
            "end_ns": recording.end_ns,
            "duration_s": ((recording.end_ns or 0) - (recording.start_ns or 0)) / 1e9,
            "distance_m": _distance_m(recording),
        }
        losses = [*recording.losses, *(log.losses if log else ())]
        return _Drive(
            entry,
            topics,
            recording.metadata.get(RUN, {}),
            log,
            tuple(f"{path}: {loss}" for loss in dict.fromkeys(losses)),
        )


def _distance_m(recording: Recording) -> float | None:
    """How far the robot went by its odometry, the first there is."""
    found = [entry.connection for entry in recording.channels if entry.connection.read_as == Odometry.ROS_TYPE]
    if not found:
        return None
    layout = layout_of(Odometry.ROS_TYPE, definition(Odometry.ROS_TYPE))
    columns = recording.columns(found[0], layout, ["pose.pose.position"])
    places = columns.table.columns["pose.pose.position"].values[:, :2]
    if not len(places):
        return None
    _, first = np.unique(columns.log_time_ns // _STEP_NS, return_index=True)
    way = np.linalg.norm(np.diff(places[[*first, -1]], axis=0), axis=1)
    return float(way[np.isfinite(way)].sum())


def _topic(name: str, mine: _Drive, theirs: _Drive) -> TopicEntry:
    sides = mine.topics.get(name), theirs.topics.get(name)
    before, after = (None if side is None else rates(side) for side in sides)
    return {"type": next(side.ros_type for side in sides if side), "baseline": before, "candidate": after}


def _statuses(mine: RunResult | None, theirs: RunResult | None) -> dict[str, MetricEntry]:
    """The share of bundles of each status."""
    return side_by_side(_shares(mine), _shares(theirs))


def _shares(run: RunResult | None) -> dict[str, float]:
    if run is None or not run.statuses or not run.bundles:
        return {}
    return {name: count / run.bundles for name, count in run.statuses.items()}


def _classes(topic: str, mine: _Drive, theirs: _Drive) -> dict[str, ClassEntry]:
    sides = mine.topics[topic], theirs.topics[topic]
    if min(len(side.times_ns) for side in sides) < 2:  # what comes once in a log is no rate
        return {}
    names = sorted({name for side in sides for name in side.classes if name})
    ways = mine.entry["distance_m"], theirs.entry["distance_m"]
    return {
        name: {"baseline": class_rates(sides[0], name, ways[0]), "candidate": class_rates(sides[1], name, ways[1])}
        for name in names
    }


def _landmarks(mine: RunResult | None, theirs: RunResult | None) -> LandmarksEntry | None:
    """Landmarks that came and went; where both used one map, those that were matched in one drive alone."""
    before, after = _map_of(mine), _map_of(theirs)
    if mine is None or theirs is None or before is None or after is None:
        return None
    if before.ids == after.ids and np.allclose(before.positions_xy, after.positions_xy):
        return _seen(before, mine, theirs)
    kept, partners = associate(after, before)
    came = sorted({*range(len(after))} - {*kept.tolist()})
    went = sorted({*range(len(before))} - {*partners.tolist()})
    return {"one_map": False, "both": len(kept), "came": _named(after, came), "went": _named(before, went)}


def _map_of(run: RunResult | None) -> SceneObjects | None:
    return None if run is None else run.landmarks or run.drawn


def _seen(landmarks: SceneObjects, mine: RunResult, theirs: RunResult) -> LandmarksEntry:
    """The landmarks of one map that were matched in both drives, and those in one alone."""
    before, after = ({name for names in run.seen.values() for name in names} for run in (mine, theirs))
    came, went, both = (
        [row for row, name in enumerate(landmarks.ids) if name in names]
        for names in (after - before, before - after, after & before)
    )
    return {"one_map": True, "both": len(both), "came": _named(landmarks, came), "went": _named(landmarks, went)}


def _named(scene: SceneObjects, rows: Sequence[int]) -> list[LandmarkEntry]:
    return [
        {
            "id": scene.ids[row],
            "class_name": scene.classes[row],
            "x_m": float(scene.positions_xy[row, 0]),
            "y_m": float(scene.positions_xy[row, 1]),
        }
        for row in rows
    ]


def _metrics(mine: ReadLog | None, theirs: ReadLog | None, known: Reference) -> dict[str, MetricEntry]:
    figures = [{} if log is None else log_figures(log, log.truth.over(known)) for log in (mine, theirs)]
    found = side_by_side(*figures)
    found.pop("bundles", None)  # as many as the drive is long
    return found
