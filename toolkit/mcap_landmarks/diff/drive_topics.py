"""What two drives have in a topic: how often messages come, how their fields are distributed, and classes."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.diff.declared import by_topic, message_counts
from mcap_landmarks.diff.distributions import LEAST, Spread, distance, finite, spread, within
from mcap_landmarks.diff.drive_document import ClassRates, FieldDistance, RateEntry, SpreadEntry
from mcap_landmarks.diff.fields import ComparedMessages, compared
from mcap_landmarks.diff.logs import Connections, shared_layout
from mcap_landmarks.diff.values import Array, Rows
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.columns import Column, Kind
from mcap_landmarks.messages.layout import Layout
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording

_SAMPLED = 2000
"""So many messages of a topic, evenly spaced, tell how its fields are distributed: to 3 % at 95 % confidence, were they
independent, and neighbours in time hardly add to that."""
_VALUES = 200_000
"""So many values of a field are kept: those of long lists, such as a scan's ranges, are thinned out."""
_GAP = 3.0
"""A step of so many times the median one is a gap: two messages in a row are missing."""
_WIDEST = 4
"""Fields of more numbers than these, such as covariances, say nothing as one distribution."""
_DRAWINGS = (MarkerArray.ROS_TYPE, ImageAnnotations.ROS_TYPE)
"""Types that show viewers what other topics say."""
_MIXED = ("id", "condition_")
"""Fields begin with these that are names, or of as many units as there are conditions."""


@dataclass(slots=True)
class DriveTopic:
    """A topic of one drive: log times (N,), and of M sampled messages the values by field and the classes found."""

    ros_type: str
    times_ns: Rows
    sampled: int = 0
    values: dict[str, Array] = field(default_factory=dict)
    classes: Counter[str] = field(default_factory=Counter)


def read_topics(recording: Recording, progress: Progress | None = None) -> dict[str, DriveTopic]:
    """Every topic of a recording; of those with payloads, such as images, the times alone."""
    connections, counts = by_topic(recording), message_counts(recording)
    layouts = {topic: _layout(own) for topic, own in connections.items()}
    times: dict[str, list[int]] = {topic: [] for topic in connections}
    held: dict[str, list[bytes]] = {topic: [] for topic in connections}
    for raw in recording.messages(progress=progress):
        topic = raw.connection.topic
        if layouts[topic] is not None and len(times[topic]) % max(1, counts[topic] // _SAMPLED) == 0:
            held[topic].append(bytes(raw.data))
        times[topic].append(raw.log_time_ns)
    found = {}
    for topic, own in sorted(connections.items()):
        found[topic] = DriveTopic(own[0].message_type, np.array(times[topic], dtype=np.int64))
        _take(found[topic], layouts[topic], held.pop(topic))
    return found


def rates(topic: DriveTopic) -> RateEntry:
    """How often the messages of a topic come."""
    steps_s = np.diff(topic.times_ns) / 1e9
    moving = steps_s[steps_s > 0]
    span_s = float(steps_s.sum())
    return {
        "messages": len(topic.times_ns),
        "rate_hz": len(steps_s) / span_s if span_s else None,
        "longest_gap_s": float(moving.max()) if len(moving) else None,
        "gaps": int(np.sum(moving > _GAP * np.median(moving))) if len(moving) else 0,
    }


def distances(baseline: DriveTopic, candidate: DriveTopic) -> dict[str, FieldDistance]:
    """How the fields that both have are distributed, those first that differ the most beyond what a drive does."""
    found: dict[str, FieldDistance] = {}
    for name in baseline.values.keys() & candidate.values.keys():
        mine, theirs = finite(baseline.values[name]), finite(candidate.values[name])
        spreads = spread(mine), spread(theirs)
        if spreads[0] is None or spreads[1] is None:
            continue
        apart, inside = distance(mine, theirs), max(within(mine), within(theirs))
        found[name] = {
            "verdict": "different" if apart > max(inside, LEAST) else "alike",
            "distance": apart,
            "within": inside,
            "baseline": _entry(spreads[0]),
            "candidate": _entry(spreads[1]),
        }
    order = sorted(found, key=lambda name: (found[name]["within"] - found[name]["distance"], name))
    return {name: found[name] for name in order}


def class_rates(topic: DriveTopic, name: str, distance_m: float | None) -> ClassRates:
    """How often a class is found in a topic of a drive of so many metres."""
    per_message = topic.classes[name] / topic.sampled if topic.sampled else 0.0
    total = per_message * len(topic.times_ns)
    minutes = float(np.ptp(topic.times_ns)) / 60e9 if len(topic.times_ns) else 0.0
    return {
        "per_message": per_message,
        "per_minute": total / minutes if minutes else None,
        "per_metre": total / distance_m if distance_m else None,
    }


def _entry(found: Spread) -> SpreadEntry:
    return {"count": found.values, "p5": found.p5, "median": found.median, "p95": found.p95}


def _layout(connections: Connections) -> Layout | None:
    layout = shared_layout(connections)
    drawn = connections[0].message_type in _DRAWINGS
    return None if layout is None or layout.has_payload or drawn else layout


def _take(topic: DriveTopic, layout: Layout | None, messages: Sequence[bytes]) -> None:
    """Take the sampled messages; those that cannot be decoded are left out, as the other diff tells them."""
    for found in _compared(topic.ros_type, layout, messages):
        topic.sampled += found.rows
        columns = (found.fields if found.items is None else found.items.fields).columns
        for path, values in (pair for name, column in columns.items() for pair in _numbers(name, column)):
            topic.values[path] = np.concatenate([topic.values.get(path, np.zeros(0)), values])
        if found.items is not None and found.items.keys == ():
            topic.classes.update(label.decode(errors="replace") for label in found.items.labels.tolist())


def _compared(ros_type: str, layout: Layout | None, messages: Sequence[bytes]) -> Iterator[ComparedMessages]:
    if layout is None or not messages:
        return
    try:
        yield compared(ros_type, layout.table(messages))
    except MessageError:
        half = len(messages) // 2
        if half:
            yield from _compared(ros_type, layout, messages[:half])
            yield from _compared(ros_type, layout, messages[half:])


def _numbers(name: str, column: Column) -> Iterator[tuple[str, Array]]:
    """The values of a column of numbers, of points and the like each coordinate for itself."""
    values = column.values
    if column.kind is not Kind.NUMBER or not len(values) or values.shape[1] > _WIDEST or name.startswith(_MIXED):
        return
    thinned = values[:: max(1, len(values) // _VALUES)].astype(np.float64)
    for i in range(thinned.shape[1]):
        yield name if thinned.shape[1] == 1 else f"{name}[{i}]", thinned[:, i]
