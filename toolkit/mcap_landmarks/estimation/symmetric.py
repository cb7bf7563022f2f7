"""Symmetric 2x2 and 3x3 matrices in closed form, one array per entry, so that thousands are solved at once."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A pivot this small beside its diagonal entry is rounding noise: the matrix says nothing in that direction.
_SINGULAR = 1e-13


class Symmetric3(NamedTuple):
    """Entries of symmetric 3x3 matrices, each (B,)."""

    xx: Array
    xy: Array
    yy: Array
    xt: Array
    yt: Array
    tt: Array


class Vector3(NamedTuple):
    """Vectors of position and heading, each (B,)."""

    x: Array
    y: Array
    t: Array


class Factor3(NamedTuple):
    """L D L^T of symmetric 3x3 matrices, heading first: unit lower entries, inverse pivots, whether `regular` (B,)."""

    lx: Array
    ly: Array
    lxy: Array
    inverse_t: Array
    inverse_x: Array
    inverse_y: Array
    regular: NDArray[np.bool_]


def inverse2(xx: Array, xy: Array, yy: Array) -> tuple[Array, Array, Array]:
    """Entries of the inverses of symmetric 2x2 matrices; all zero where a matrix is not positive definite or finite."""
    det = xx * yy - xy * xy
    positive = (xx > 0) & (yy > 0) & (det > 0) & (det < np.inf)
    scale = np.divide(1.0, det, out=np.zeros_like(det), where=positive)
    inverse = (yy * scale, -xy * scale, xx * scale)
    if positive.all():
        return inverse
    return (
        np.where(positive, inverse[0], 0.0),
        np.where(positive, inverse[1], 0.0),
        np.where(positive, inverse[2], 0.0),
    )


def factor3(a: Symmetric3, damping: Array | float = 0.0) -> Factor3:
    """Factor a + damping * diag(a). Where a matrix is singular or not positive definite, `regular` is False."""
    grow = 1.0 + damping
    tt, xx_damped, yy_damped = a.tt * grow, a.xx * grow, a.yy * grow
    t_ok = tt > 0
    inverse_t = 1.0 / np.where(t_ok, tt, 1.0)
    lx, ly = a.xt * inverse_t, a.yt * inverse_t
    xx = xx_damped - a.xt * lx
    x_ok = xx > _SINGULAR * xx_damped
    inverse_x = 1.0 / np.where(x_ok, xx, 1.0)
    xy = a.xy - a.xt * ly
    lxy = xy * inverse_x
    yy = yy_damped - a.yt * ly - xy * lxy
    y_ok = yy > _SINGULAR * yy_damped
    inverse_y = 1.0 / np.where(y_ok, yy, 1.0)
    return Factor3(lx, ly, lxy, inverse_t, inverse_x, inverse_y, t_ok & x_ok & y_ok)


def solve3(f: Factor3, right: Vector3) -> Vector3:
    """Solutions (x, y, t) of the factored systems; zero where the factor is not regular."""
    x, y, t = right
    x = x - f.lx * t
    y = (y - f.ly * t - f.lxy * x) * f.inverse_y * f.regular
    x = x * f.inverse_x * f.regular - f.lxy * y
    t = t * f.inverse_t * f.regular - f.lx * x - f.ly * y
    return Vector3(x, y, t)


def inverse3(f: Factor3) -> Array:
    """Inverses (B, 3, 3); infinite diagonal and zero elsewhere where the factor is not regular."""
    # Rows of L^-1, scaled by the pivots: the inverse is a sum of their outer products, so it stays positive definite.
    tx = f.ly - f.lx * f.lxy
    out = np.empty((len(f.lx), 3, 3))
    out[:, 1, 1] = f.inverse_y
    out[:, 0, 1] = out[:, 1, 0] = -f.lxy * f.inverse_y
    out[:, 1, 2] = out[:, 2, 1] = -tx * f.inverse_y
    out[:, 0, 0] = f.inverse_x + f.lxy * f.lxy * f.inverse_y
    out[:, 0, 2] = out[:, 2, 0] = -f.lx * out[:, 0, 0] - f.ly * out[:, 0, 1]
    out[:, 2, 2] = f.inverse_t + f.lx * f.lx * f.inverse_x + tx * tx * f.inverse_y
    if not f.regular.all():
        out[~f.regular] = np.diag([np.inf] * 3)
    return out
