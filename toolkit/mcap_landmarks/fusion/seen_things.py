"""Boxes of an image that are of one thing: what is told twice, and people with what they ride."""

from dataclasses import dataclass, replace

import numpy as np

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.hypotheses import Hypotheses

_ALIKE = (frozenset({"car", "van", "truck", "bus", "train"}), frozenset({"bicycle", "motorcycle"}))
"""Classes that detectors give one thing several of: vehicles, and what has two wheels."""
_RIDDEN = {"bicycle": "cyclist", "motorcycle": "motorcycle"}
"""What people ride, and what it is called with them."""
_RIDER = "person"
_NOTHING_PX2 = 1e-9
"""Boxes without any area share nothing."""
_SAME = 0.6
"""Boxes of such classes that overlap by more (intersection over union) are of one thing: detectors suppress them within
a class only."""
_RIDING = 0.15
"""A person who rides has at least this share of its box in that of what it rides: feet and legs."""
_ASIDE = 0.4
"""How far a rider's middle is off that of what it rides, at most, as a share of the wider of both."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One thing in an image: box_xyxy (4,) in pixels, its classes with their shares, most likely first, which sum to 1,
    the probability `score` that something is there, and how many boxes it was."""

    box_xyxy: Array
    classes: Hypotheses
    score: float
    boxes: int = 1

    @property
    def name(self) -> str:
        """Its most likely class."""
        return self.classes[0][0]


def seen_things(detections: Detections) -> list[Seen]:
    """The things that the boxes of an image are of, the surest first."""
    things = []
    for box, options in zip(detections.boxes_xyxy, detections.hypotheses, strict=True):
        things.append(Seen(box, ((options[0][0], 1.0),), float(options[0][1])))
    things.sort(key=lambda thing: -thing.score)
    return _riders_joined(_alike_joined(things))


def overlap(one: Array, other: Array) -> float:
    """The area in pixels that two boxes share."""
    low, high = np.maximum(one[:2], other[:2]), np.minimum(one[2:], other[2:])
    return float(np.prod(np.maximum(high - low, 0.0)))


def intersection_over_union(one: Array, other: Array) -> float:
    """The share of the area of two boxes, in pixels, that both have."""
    shared = overlap(one, other)
    return shared / max(_area(one) + _area(other) - shared, _NOTHING_PX2)


def _area(box: Array) -> float:
    return float(np.prod(box[2:] - box[:2]))


def _alike_joined(things: list[Seen]) -> list[Seen]:
    kept: list[Seen] = []
    for thing in things:
        same = next((i for i, other in enumerate(kept) if _are_one(thing, other)), None)
        if same is None:
            kept.append(thing)
        else:
            kept[same] = _told_twice(kept[same], thing)
    return kept


def _are_one(one: Seen, other: Seen) -> bool:
    """Whether two boxes are of one thing."""
    may_be = any(one.name in alike and other.name in alike for alike in _ALIKE)
    return may_be and intersection_over_union(one.box_xyxy, other.box_xyxy) > _SAME


def _told_twice(surer: Seen, other: Seen) -> Seen:
    """One thing that has two boxes of two classes, which share it by their scores."""
    shares: dict[str, float] = {}
    for thing in (surer, other):
        for name, share in thing.classes:
            shares[name] = shares.get(name, 0.0) + share * thing.score
    whole = sum(shares.values())
    classes = tuple(sorted(((name, share / whole) for name, share in shares.items()), key=lambda entry: -entry[1]))
    return replace(surer, classes=classes, boxes=surer.boxes + other.boxes)


def _riders_joined(things: list[Seen]) -> list[Seen]:
    left = list(things)
    for thing in things:
        riders = [person for person in left if person.name == _RIDER and _rides(person, thing)]
        if thing.name in _RIDDEN and riders:
            rider = max(riders, key=lambda one: overlap(one.box_xyxy, thing.box_xyxy) / _area(one.box_xyxy))
            left = [one for one in left if one is not rider and one is not thing] + [_ridden(rider, thing)]
    return sorted(left, key=lambda thing: -thing.score)


def _ridden(rider: Seen, thing: Seen) -> Seen:
    """A rider with what it rides."""
    low = np.minimum(rider.box_xyxy[:2], thing.box_xyxy[:2])
    high = np.maximum(rider.box_xyxy[2:], thing.box_xyxy[2:])
    classes, score = ((_RIDDEN[thing.name], 1.0),), max(rider.score, thing.score)
    return Seen(np.concatenate([low, high]), classes, score, rider.boxes + thing.boxes)


def _rides(person: Seen, thing: Seen) -> bool:
    """Whether a person sits on something: it is above it, in its middle, and its legs are in its box."""
    one, other = person.box_xyxy, thing.box_xyxy
    wide = max(one[2] - one[0], other[2] - other[0])
    aside = abs((one[0] + one[2]) - (other[0] + other[2])) / 2
    above = one[1] < other[1] and one[3] < other[3] + 0.1 * (other[3] - other[1])
    return bool(above and aside < _ASIDE * wide and overlap(one, other) > _RIDING * _area(one))
