"""Which box is of which object: gates, likelihood ratios, and the most likely assignment."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.fusion.box_geometry import BoxGeometry, misfits
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.class_centres import centres_of, radii_in_boxes
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scan_objects import ScanObjects

Pair = tuple[int, int]

_NEVER = 1e6
"""The cost of what cannot be: more than all else together."""
_UNSEEN_PER_RAD = 0.3
"""Boxes of a class, per image and radian, of what is too far away, too thin or hidden for the LiDAR. The generator's
log `cluttered` (seed 3) has 0.21 on the mean of its classes, 0.57 of persons and chairs."""
_ASIDE, _UPRIGHT = 1.3, 2.0
"""How much more chi-squares of bearing and size tell than sigmas say, which are wide for gates. By the errors in that
log, with boxes spoilt by 1 px and 3 % of their size, it could be 2.3 and 7; real boxes err more."""
_LEAST_FIT = 0.05
"""Real objects differ from the shapes of their class, so that a scan never speaks more against it; in that log 98 % fit
twice as well."""
_USUAL_FIT = 0.5
"""How well the scan fits a class where it does not speak for it or against it; in that log the median is 0.47."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxCandidates:
    """M boxes as N objects: ratios (M, N), how much likelier a box is if it is of an object than if it is of something
    that the scan does not show, 0 where it cannot be; the same with what is known of the objects in `odds` (M, N); how
    far aside the object is (M, N), in sigmas; radii_m (M, N) that it would have.
    """

    ratios: Array
    odds: Array
    aside: Array
    radii_m: Array


def candidates(
    objects: ScanObjects, tracks: TrackTable, view: CameraView, boxes: BoxGeometry, names: Sequence[str]
) -> BoxCandidates:
    """Every box, with its class, as every object; a gate (Bar-Shalom and Fortmann 1988) decides what it can be."""
    shape, config = (len(names), len(objects)), tracks.config
    found = BoxCandidates(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape))
    for box, name in enumerate(names):
        size = config.size(name)
        found.radii_m[box] = radii_in_boxes(objects, view, boxes, box, size)
        centres = centres_of(objects, name, found.radii_m[box], has_shape=name in tracks.shaped)
        places = centres.positions_xy, centres.covariances
        aside, sigma, upright = misfits(view, boxes, box, places, size, config)
        possible = (aside**2 <= config.bearing_gate) & (upright <= config.size_gate)
        density = np.exp(-(_ASIDE * aside**2 + _UPRIGHT * upright) / 2) / (math.sqrt(2 * math.pi / _ASIDE) * sigma)
        fits = np.maximum(centres.fits, _LEAST_FIT) / _USUAL_FIT
        told = 1.0 if boxes.cut[box, [1, 3]].any() else size.telling
        ratios = np.where(possible, told * density / _UNSEEN_PER_RAD * fits, 0.0)
        odds = np.array([tracks[track].belief.share(name) for track in objects.ids])
        found.ratios[box], found.odds[box], found.aside[box] = ratios, ratios * odds, aside
    return found


def assign(odds: Array) -> list[Pair]:
    """Pairs (box, object) of the most likely assignment, where a box may be of nothing in the scan.

    Hungarian assignment (Kuhn 1955) with odds (M, N) as gains and a way out for every box, as scipy solves it
    (Crouse 2016).
    """
    boxes, objects = odds.shape
    with np.errstate(divide="ignore"):
        costs = np.hstack([np.maximum(-np.log(odds), -_NEVER), np.zeros((boxes, boxes))])
    rows, columns = linear_sum_assignment(np.where(np.isfinite(costs), costs, _NEVER))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if j < objects and odds[i, j] > 1]


def hit_ratio(found: BoxCandidates, pairs: Sequence[Pair], pair: Pair, score: float) -> float:
    """How much likelier a box is if it is of its object than if not, given what else it could be of, and its score.

    That is nothing in the scan, or an object that no other box is of. A box that the detector is not sure of tells
    less.
    """
    box, i = pair
    taken = [j for other, j in pairs if other != box]
    alternatives = 1.0 + float(np.delete(found.odds[box], [i, *taken]).sum())
    return 1 - score + score * float(found.ratios[box, i]) / alternatives
