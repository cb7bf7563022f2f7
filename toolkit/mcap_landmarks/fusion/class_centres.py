"""Where the objects in a scan are if they are of a class: their centres, and how well the scan fits that."""

from dataclasses import dataclass

import numpy as np

from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import BoxGeometry
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scan_objects import ScanObjects

SURFACE = ""
"""The hypothesis of no known shape: the middle of the near surface."""

RESOLVED = 0.01
"""A shape that fits a cluster worse has no centre that counts: hits of several things have run together. Of objects in
the generator's log `cluttered` (seed 3) 98 % fit ten times better."""
_LEAST_FIT = 1e-3
"""What no shape of a class explains fits it by so much: less than what counts, and more than nothing."""
_RADIUS_ERROR = 0.3
"""Radii that come from boxes and classes are sure to such a share: an object's section may be of any form."""
_WIDEST_SINE = 0.9
"""Of the half angle of a box: a disc that fills a wider one would have its centre on the camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Centres:
    """Positions (N, 2), covariances (N, 2, 2) and fits (N,) of N objects under one class; a fit is at most 1."""

    positions_xy: Array
    covariances: Array
    fits: Array


def centres_of(objects: ScanObjects, name: str, radii_m: Array, *, has_shape: bool) -> Centres:
    """Centres by the class's own most probable shape; without one, of discs of radii (N,) behind the surface.

    A cluster without a hypothesis of a class that has shapes fits none of them.
    """
    found = [centre_of(objects, i, name, radii_m[i], has_shape=has_shape) for i in range(len(objects))]
    return Centres(
        np.array([position for position, _, _ in found]).reshape(-1, 2),
        np.array([covariance for _, covariance, _ in found]).reshape(-1, 2, 2),
        np.array([fit for _, _, fit in found], dtype=np.float64),
    )


def centre_of(
    objects: ScanObjects, i: int, name: str, radius_m: float, *, has_shape: bool
) -> tuple[Array, Array, float]:
    """Position (2,), covariance (2, 2) and fit of one object, as in `centres_of`."""
    row = next((k for k, (known, _) in enumerate(objects.hypotheses[i]) if known == name), None)
    if row is None:
        place = _behind(objects.positions_xy[i][-1], objects.covariances[i][-1], radius_m)
        return *place, _LEAST_FIT if has_shape else 1.0
    return objects.positions_xy[i][row], objects.covariances[i][row], _fits_of(objects, i)[name]


def is_resolved(objects: ScanObjects, i: int, name: str, *, has_shape: bool) -> bool:
    """Whether the scan shows where the centre of an object is, if it is of a class."""
    return _fits_of(objects, i).get(name, 0.0 if has_shape else 1.0) >= RESOLVED


def _fits_of(objects: ScanObjects, i: int) -> dict[str, float]:
    """How well the scan fits each class: the probability of its shapes where only they and the bare surface could be.

    It is very small where hits of several things have run together.
    """
    shares: dict[str, float] = {}
    for name, share in objects.hypotheses[i]:
        shares[name] = shares.get(name, 0.0) + share
    bare = shares.pop(SURFACE, 0.0)
    return {name: max(share / (share + bare), _LEAST_FIT) if share else _LEAST_FIT for name, share in shares.items()}


def radii_in_boxes(objects: ScanObjects, view: CameraView, boxes: BoxGeometry, box: int, size: Size) -> Array:
    """Radii (N,) of discs that have the objects' surfaces in front and fill the width of one box."""
    surfaces = np.array([positions[-1] for positions in objects.positions_xy]).reshape(-1, 2)
    distance = np.hypot(*view.from_camera(surfaces).T)
    sine = min(float(np.sin(boxes.half[box])), _WIDEST_SINE)
    radii: Array = np.minimum(distance * sine / (1 - sine), size.width_m[1] / 2)
    return radii


def _behind(surface_xy: Array, covariance: Array, radius_m: float) -> tuple[Array, Array]:
    """Centre and covariance of a disc that has a surface in front."""
    distance = float(np.hypot(*surface_xy))
    ahead = surface_xy / distance if distance > 0 else np.array([1.0, 0.0])
    return surface_xy + radius_m * ahead, covariance + (_RADIUS_ERROR * radius_m) ** 2 * np.outer(ahead, ahead)
