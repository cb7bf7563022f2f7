"""Objects that several cameras see beside one cloud: what overlapping views show of one thing is one object."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.camera_view import SeenImage
from mcap_landmarks.fusion.cloud_objects import FoundObject, Look, find
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.frustum import CloudView
from mcap_landmarks.fusion.seen_things import Seen, seen_things
from mcap_landmarks.lidar.rectangles import Rectangle
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud

_SHARED = 0.5
"""Two objects with so many of their points in common, as a share of the fewer, are one: most of what one view takes for
its object the other does, too, whereas neighbours only dispute their edges."""
_GATE = 9.21
"""Where points do not tell, two objects of one class are one if their distance is in its 99 % region: chi-square
of two degrees of freedom (Bar-Shalom and Fortmann 1988)."""


class ViewedObject(NamedTuple):
    """An object of one view: the view, the thing that its box is of, and where it was found."""

    look: Look
    thing: Seen
    found: FoundObject

    @property
    def is_cut(self) -> bool:
        """Whether the left or the right edge of the image cuts its box."""
        return bool(self.look.boxes.cut[self.found.box, [0, 2]].any())


_Views = dict[int, ViewedObject]
"""What views show of one object, by their numbers."""


def objects_in(cloud: ClusteredCloud, image: SeenImage, config: FuseConfig) -> list[ViewedObject]:
    """The objects that one image and a cloud show, in the order of their boxes."""
    things = seen_things(image.detections)
    boxes = box_geometry(image.view, np.array([thing.box_xyxy for thing in things]).reshape(-1, 4), config)
    look = Look(image.view, CloudView.of(cloud, image.view), boxes, config)
    found = [one for one in find(look, things) if one.score >= config.min_probability]
    return [ViewedObject(look, things[one.box], one) for one in found]


def distinct(views: Sequence[Sequence[ViewedObject]]) -> list[list[ViewedObject]]:
    """Every object once: what the views show of it, that first which tells best where it is.

    Of those of one view that stand in each other only the surest is left; of several views each has its own.
    """
    everything = [(i, one) for i, view in enumerate(views) for one in view]
    kept: list[_Views] = []
    for i, one in sorted(everything, key=lambda entry: (len(entry[1].found.points) == 0, -entry[1].found.score)):
        if any(i in other and _stand_in_each_other(one, other[i]) for other in kept):
            continue
        same = [other for other in kept if i not in other and _is_of(one, other)]
        if same:
            min(same, key=lambda other: _apart_m(one, other))[i] = one
        else:
            kept.append({i: one})
    return [sorted(seen.values(), key=_how_well) for seen in sorted(kept, key=_first_box)]


def _first_box(seen: _Views) -> tuple[int, int]:
    return min((i, one.found.box) for i, one in seen.items())


def _is_of(one: ViewedObject, seen: _Views) -> bool:
    return any(_are_one(one, other) for other in seen.values())


def _how_well(one: ViewedObject) -> tuple[bool, bool, float]:
    """Least for the view that tells best where an object is: by points, and seen as a whole."""
    return len(one.found.points) == 0, one.is_cut, -one.found.score


def _are_one(one: ViewedObject, other: ViewedObject) -> bool:
    """Whether what two cameras see is one object: by where it stands, by its points, or as well as the camera tells."""
    if _stand_in_each_other(one, other):
        return True
    mine, theirs = one.look.cloud.rows[one.found.points], other.look.cloud.rows[other.found.points]
    if len(mine) and len(theirs):
        return len(np.intersect1d(mine, theirs)) > _SHARED * min(len(mine), len(theirs))
    off = one.found.place.centre_xy - other.found.place.centre_xy
    spread = one.found.place.covariance + other.found.place.covariance
    return one.thing.name == other.thing.name and float(off @ np.linalg.solve(spread, off)) <= _GATE


def _stand_in_each_other(one: ViewedObject, other: ViewedObject) -> bool:
    return _is_in(one.found.place, other.found.place) or _is_in(other.found.place, one.found.place)


def _is_in(one: Rectangle, other: Rectangle) -> bool:
    """Whether the middle of one is in the other."""
    return bool(other.holds(one.centre_xy[None], 0.0)[0])


def _apart_m(one: ViewedObject, others: _Views) -> float:
    return min(float(np.hypot(*(one.found.place.centre_xy - other.found.place.centre_xy))) for other in others.values())
