"""Range and bearing residuals of many poses at once, and their normal equations."""

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation import robust
from mcap_landmarks.estimation.symmetric import Symmetric3, Vector3

Array = NDArray[np.float64]
Arrays = TypeVar("Arrays", bound=tuple[Any, ...])


class Observations(NamedTuple):
    """Observations of B poses, one array (K, B) per quantity; weights are zero where there is none."""

    landmark_x: Array
    landmark_y: Array
    range_m: Array
    direction_x: Array
    direction_y: Array
    weight_rr: Array
    weight_rb: Array
    weight_bb: Array


class Poses(NamedTuple):
    """B poses as position, cosine and sine of the heading, each (B,)."""

    x: Array
    y: Array
    cosine: Array
    sine: Array

    def moved(self, step: Vector3) -> "Poses":
        """These poses plus a step in x, y (map frame) and heading; turns go by the Cayley map, which needs no sine."""
        x, y, turn = step
        half = turn / 2
        scale = 1 / (1 + half * half)
        c, s = (1 - half * half) * scale, turn * scale
        return Poses(self.x + x, self.y + y, self.cosine * c - self.sine * s, self.sine * c + self.cosine * s)


class Linearised(NamedTuple):
    """Gauss-Newton's equations of B poses, with their cost and the squared distance (K, B) of each observation."""

    cost: Array
    right: Vector3
    information: Symmetric3
    chi2: Array


def linearise(observed: Observations, poses: Poses, robust_dof: float | None, *, newton: bool = True) -> Linearised:
    """Gauss-Newton's equations at `poses`, with Student-t weights of `robust_dof` degrees unless None.

    With `newton` the information is the one for steps, which knows how the robust loss bends; else the weighted one.
    """
    dx, dy = observed.landmark_x - poses.x, observed.landmark_y - poses.y
    # A pose on top of a landmark has no bearing to it: keep the numbers finite there.
    square = np.maximum(dx * dx + dy * dy, 1e-12)
    distance = np.sqrt(square)
    dx_east = poses.cosine * observed.direction_x - poses.sine * observed.direction_y
    dy_north = poses.sine * observed.direction_x + poses.cosine * observed.direction_y
    e_range = observed.range_m - distance
    e_bearing = np.arctan2(dx * dy_north - dy * dx_east, dx * dx_east + dy * dy_north)
    w_rr, w_rb, w_bb = observed.weight_rr, observed.weight_rb, observed.weight_bb
    f_range = w_rr * e_range + w_rb * e_bearing
    f_bearing = w_rb * e_range + w_bb * e_bearing
    chi2 = e_range * f_range + e_bearing * f_bearing
    if robust_dof is None:
        cost = chi2.sum(axis=0)
    else:
        cost = robust.student_loss(chi2, robust_dof).sum(axis=0)
        weight = robust.student_weight(chi2, robust_dof)
        w_rr, w_rb, w_bb = weight * w_rr, weight * w_rb, weight * w_bb
        if newton:
            bend = robust.student_curvature(chi2, weight, robust_dof)
            w_rr = w_rr - bend * f_range * f_range
            w_rb = w_rb - bend * f_range * f_bearing
            w_bb = w_bb - bend * f_bearing * f_bearing
        f_range, f_bearing = weight * f_range, weight * f_bearing
    rx, ry = dx / -distance, dy / -distance  # derivatives of the range by the position
    bx, by = dy / square, dx / -square  # and of the bearing; that by the heading is -1
    rx_w, ry_w = w_rr * rx + w_rb * bx, w_rr * ry + w_rb * by
    bx_w, by_w = w_rb * rx + w_bb * bx, w_rb * ry + w_bb * by
    information = Symmetric3(
        xx=(rx * rx_w + bx * bx_w).sum(axis=0),
        xy=(rx * ry_w + bx * by_w).sum(axis=0),
        yy=(ry * ry_w + by * by_w).sum(axis=0),
        xt=-bx_w.sum(axis=0),
        yt=-by_w.sum(axis=0),
        tt=w_bb.sum(axis=0),
    )
    x = (rx * f_range + bx * f_bearing).sum(axis=0)
    y = (ry * f_range + by * f_bearing).sum(axis=0)
    return Linearised(cost, Vector3(x, y, -f_bearing.sum(axis=0)), information, chi2)


def select(arrays: Arrays, columns: NDArray[np.bool_]) -> Arrays:
    """The same arrays, with the chosen columns only."""
    return type(arrays)(*(select(a, columns) if isinstance(a, tuple) else a[..., columns] for a in arrays))


def choose(first: NDArray[np.bool_], a: Arrays, b: Arrays) -> Arrays:
    """Columns of `a` where `first`, else of `b`."""
    pairs = zip(a, b, strict=True)
    return type(a)(*(choose(first, x, y) if isinstance(x, tuple) else np.where(first, x, y) for x, y in pairs))
