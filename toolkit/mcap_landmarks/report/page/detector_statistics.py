"""What a detector said over a whole log: how often which class, how surely, and how much of it is true."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.channels import DETECTIONS, TRUTH_DETECTIONS
from mcap_landmarks.errors import MessageError
from mcap_landmarks.evaluation.audition import SAME_IOU
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.columns import Table
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.typestore import definition_in
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Channel

_AT_ONCE = 2000
"""So many messages become columns together; memory stays small."""
_BINS = np.linspace(0.0, 1.0, 21)
Corners = tuple[float, float, float, float]
Boxes = tuple[list[str], list[float], list[Corners]]
"""Of one image: class names of K boxes, their scores and corners (least x and y, greatest x and y)."""
_Image = tuple[bytes, int]
"""Frame and stamp: images of two cameras may have one stamp."""


@dataclass(frozen=True, slots=True, eq=False)
class ClassStatistics:
    """One class: boxes, quartiles of their scores, counts (20,) of scores in twentieths, and against the truth.

    Of images with a truth: so many boxes were `judged`, of these `true` are of a true object of the class, and `missed`
    true objects have none.
    """

    name: str
    boxes: int
    quartiles: tuple[float, float, float]
    histogram: tuple[int, ...]
    judged: int
    true: int
    missed: int


@dataclass(frozen=True, slots=True, eq=False)
class DetectorStatistics:
    """All images: how many were looked at, how many have no box, how many have a truth, and what of each class."""

    images: int
    empty: int
    with_truth: int
    classes: tuple[ClassStatistics, ...]


def detector_statistics(recording: Recording) -> DetectorStatistics | None:
    """What the detections of a recording are, None where it has none; against its true ones, if it has any.

    A box is true if it overlaps one of its class by half, which no other one does better (one to one).
    """
    truth = dict(_images(recording, TRUTH_DETECTIONS))
    scores: dict[str, list[float]] = defaultdict(list)
    images = empty = compared = 0
    judged, true, missed = Counter[str](), Counter[str](), Counter[str]()
    for image, found in _images(recording, DETECTIONS):
        images += 1
        empty += not found[0]
        for name, score in zip(found[0], found[1], strict=True):
            scores[name].append(score)
        if image in truth:
            compared += 1
            hits, left = _compared(found, truth[image])
            judged.update(found[0])
            true.update(hits)
            missed.update(left)
    if not images:
        return None
    names = sorted({*scores, *missed}, key=lambda name: (-len(scores.get(name, ())), name))
    classes = tuple(
        _class(name, np.array(scores.get(name, [])), (judged[name], true[name], missed[name])) for name in names
    )
    return DetectorStatistics(images, empty, compared, classes)


def _class(name: str, scores: Array, against: tuple[int, int, int]) -> ClassStatistics:
    low, middle, high = np.percentile(scores, (25, 50, 75)).tolist() if len(scores) else (0.0, 0.0, 0.0)
    counts, _ = np.histogram(np.clip(scores, 0.0, 1.0), _BINS)
    return ClassStatistics(name, len(scores), (low, middle, high), tuple(counts.tolist()), *against)


def _compared(found: Boxes, truth: Boxes) -> tuple[list[str], list[str]]:
    """The classes of boxes that are true, and of true ones that no box is of."""
    names, _, boxes = found
    others, _, corners = truth
    pairs = {
        (i, j): overlap
        for (i, box), (j, other) in product(enumerate(boxes), enumerate(corners))
        if names[i] == others[j] and (overlap := _overlap(box, other)) >= SAME_IOU
    }
    paired = {j for _, j in pairs}
    if len(pairs) > min(len(paired), len({i for i, _ in pairs})):  # there is something to choose
        paired = _best(pairs, (len(boxes), len(corners)))
    return [others[j] for j in sorted(paired)], [name for j, name in enumerate(others) if j not in paired]


def _best(pairs: Mapping[tuple[int, int], float], shape: tuple[int, int]) -> set[int]:
    """The true ones that have a box, where the pairs are one to one and their overlap is the largest in all."""
    overlaps = np.zeros(shape)
    for pair, overlap in pairs.items():
        overlaps[pair] = overlap
    mine, theirs = linear_sum_assignment(-overlaps)
    return {j for i, j in zip(mine.tolist(), theirs.tolist(), strict=True) if (i, j) in pairs}


def _overlap(box: Corners, other: Corners) -> float:
    """Intersection over union; in plain numbers, as images have few boxes and there are many images."""
    left, top, right, bottom = box
    other_left, other_top, other_right, other_bottom = other
    width = min(right, other_right) - max(left, other_left)
    height = min(bottom, other_bottom) - max(top, other_top)
    if width <= 0.0 or height <= 0.0:
        return 0.0
    shared = width * height
    areas = (right - left) * (bottom - top) + (other_right - other_left) * (other_bottom - other_top)
    return shared / max(areas - shared, 1e-9)


def _images(recording: Recording, channel: Channel[Message]) -> Iterator[tuple[_Image, Boxes]]:
    """The image and the boxes of every message of a channel that can be read."""
    ros_type = channel.message.ROS_TYPE
    for connection in recording.connections(channel.topic):
        if connection.read_as != ros_type:
            continue
        schema = definition_in(ros_type, connection.schema.decode(errors="replace"))
        held: list[bytes] = []
        for raw in recording.messages([connection]):
            held.append(bytes(raw.data))
            if len(held) == _AT_ONCE:
                yield from _boxes(ros_type, schema, held)
                held = []
        yield from _boxes(ros_type, schema, held)


def _boxes(ros_type: str, schema: str, messages: list[bytes]) -> Iterator[tuple[_Image, Boxes]]:
    """Boxes without a class are left out; messages that cannot be decoded, too: evaluation counts what is lost."""
    if not messages:
        return
    try:
        table = layout_of(ros_type, schema).table(messages)
    except MessageError:
        half = len(messages) // 2
        if half:
            yield from _boxes(ros_type, schema, messages[:half])
            yield from _boxes(ros_type, schema, messages[half:])
        return
    yield from _boxes_of(table)


def _boxes_of(table: Table) -> Iterator[tuple[_Image, Boxes]]:
    counts, boxes = table.children["detections"]
    results, options = boxes.children["results"]
    first = np.cumsum(results) - results
    classed = results > 0
    names = np.full(len(results), "", dtype=object)
    scores = np.zeros(len(results))
    names[classed] = [
        name.decode(errors="replace") for name in options.columns["hypothesis.class_id"].values[first[classed], 0]
    ]
    scores[classed] = options.columns["hypothesis.score"].values[first[classed], 0]
    middle = boxes.columns["bbox.center.position"].values
    half_sides = np.hstack([boxes.columns[f"bbox.size_{axis}"].values for axis in "xy"]) / 2
    corners = [tuple(row) for row in np.hstack([middle - half_sides, middle + half_sides]).tolist()]
    ends = np.cumsum(counts)
    frames, stamps = (table.columns[f"header.{name}"].values[:, 0].tolist() for name in ("frame_id", "stamp"))
    every = list(zip(names.tolist(), scores.tolist(), corners, strict=True))
    for *image, start, end in zip(frames, stamps, (ends - counts).tolist(), ends.tolist(), strict=True):
        kept = [box for box, has_class in zip(every[start:end], classed[start:end], strict=True) if has_class]
        yield (image[0], image[1]), ([box[0] for box in kept], [box[1] for box in kept], [box[2] for box in kept])
