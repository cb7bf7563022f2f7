"""The scene of a scan: its objects whose class is known well enough."""

from typing import NamedTuple

import numpy as np

from mcap_landmarks.fusion.class_centres import is_resolved
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

LEAST_TOLD = 0.005
"""Classes less probable are not told: markers show whole percents."""
_APART = 1.25
"""Two objects of one class are farther apart than this many of its radii; two discs that touch would be two apart, and
centres err."""


class _Found(NamedTuple):
    """One object of a scan, with its classes and what it is like if it is of the most probable one."""

    i: int
    options: Hypotheses
    position_xy: Array
    covariance: Array
    radius_m: float


def scene_of(objects: ScanObjects, tracks: TrackTable) -> SceneObjects:
    """Objects whose class is known well enough; of several of one class in one place the surest."""
    kept = sorted(_apart(_found(objects, tracks)), key=lambda one: one.i)
    return SceneObjects(
        objects.stamp_ns,
        objects.frame_id,
        tuple(objects.ids[one.i] for one in kept),
        tuple(tuple(option for option in one.options if option[1] >= LEAST_TOLD) for one in kept),
        np.array([one.position_xy for one in kept]).reshape(-1, 2),
        np.array([one.covariance for one in kept]).reshape(-1, 2, 2),
        np.array([one.radius_m for one in kept], dtype=np.float64),
    )


def _apart(found: list[_Found]) -> list[_Found]:
    """The surest first; none of a class in the place of a surer one."""
    kept: list[_Found] = []
    for one in sorted(found, key=lambda one: (-one.options[0][1], one.i)):
        same = [other for other in kept if other.options[0][0] == one.options[0][0]]
        if all(np.hypot(*(one.position_xy - other.position_xy)) > _APART * one.radius_m for other in same):
            kept.append(one)
    return kept


def _found(objects: ScanObjects, tracks: TrackTable) -> list[_Found]:
    """Objects that are sure enough of a class, whose boxes no other track explains, and whose centre the scan shows."""
    found = []
    for i, track in enumerate(objects.ids):
        name, probability = tracks[track].belief.best()
        if not name or probability < tracks.config.min_probability or tracks[track].is_redundant:
            continue
        if is_resolved(objects, i, name, has_shape=name in tracks.shaped):
            options = tuple(tracks[track].belief.probabilities())
            found.append(_Found(i, options, *tracks.centre(objects, i, name), tracks.radius_m(track, name)))
    return found
