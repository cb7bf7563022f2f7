"""Position from three landmarks as others compute it, for comparison only: one problem at a time."""

import cmath
import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sayed(landmarks_xy: Array, range_m: Array) -> Array:
    """Position (2,) from three or more ranges: differences of their squares are linear (Sayed et al. 2005)."""
    d = landmarks_xy[1:] - landmarks_xy[0]
    right = ((d**2).sum(axis=1) - range_m[1:] ** 2 + range_m[0] ** 2) / 2
    return np.asarray(landmarks_xy[0] + np.linalg.lstsq(d, right, rcond=None)[0])


def total(landmarks_xy: Array, bearing_rad: Array) -> Array:
    """Position (2,) from three bearings: the radical centre of three circles (Pierlot and Van Droogenbroeck 2014)."""
    (x1, y1), (x2, y2), (x3, y3) = landmarks_xy.tolist()
    x1, y1, x3, y3 = x1 - x2, y1 - y2, x3 - x2, y3 - y2
    first, second, third = bearing_rad.tolist()
    t12, t23 = 1 / math.tan(second - first), 1 / math.tan(third - second)
    t31 = (1 - t12 * t23) / (t12 + t23)
    x12, y12 = x1 + t12 * y1, y1 - t12 * x1
    x23, y23 = x3 - t23 * y3, y3 + t23 * x3
    x31, y31 = x3 + x1 + t31 * (y3 - y1), y3 + y1 - t31 * (x3 - x1)
    k31 = x1 * x3 + y1 * y3 + t31 * (x1 * y3 - x3 * y1)
    d = (x12 - x23) * (y23 - y31) - (y12 - y23) * (x23 - x31)
    return np.array([x2 + k31 * (y12 - y23) / d, y2 + k31 * (x23 - x12) / d])


def betke_gurvits(landmarks_xy: Array, bearing_rad: Array) -> Array:
    """Position (2,) from three or more bearings by complex numbers, in linear time (Betke and Gurvits 1997).

    The ratio of two distances is the least-squares solution of what each further landmark says about it.
    """
    z = [complex(x, y) for x, y in landmarks_xy.tolist()]
    turn = [cmath.exp(1j * (b - bearing_rad[0])) for b in bearing_rad.tolist()]
    top = bottom = 0.0
    for z_i, turn_i in zip(z[2:], turn[2:], strict=True):
        c = (z_i - z[0]) / (z[1] - z[0])
        slope, value = (-c * turn[1] / turn_i).imag, ((1 - c) / turn_i).imag
        top, bottom = top + slope * value, bottom + slope * slope
    ratio = top / bottom
    first = (z[1] - z[0]) / (ratio * turn[1] - 1)  # from robot to first landmark, in the map's axes
    place = z[0] - first
    return np.array([place.real, place.imag])
