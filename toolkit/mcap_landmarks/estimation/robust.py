"""M-estimation with Student-t weights, which keep wrong observations from pulling, and what it does to covariances."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The share of an observation's weight that the correction may take: all of it would leave no step along the residual.
_MOST_BENT = 0.9
# Nodes of Gauss-Laguerre quadrature: sixty give the factor to nine digits for three degrees of freedom.
_NODES = 60


def student_weight(chi2: Array, dof: float) -> Array:
    """Weights in (0, 1] of observations with squared Mahalanobis distance `chi2` under a Student-t of `dof` degrees.

    Lange, Little and Taylor 1989, scaled to 1 at distance zero: those of a Cauchy kernel of squared width `dof`.
    """
    return dof / (dof + chi2)


def student_loss(chi2: Array, dof: float) -> Array:
    """Loss whose slope over `chi2` is `student_weight`."""
    return dof * np.log1p(chi2 / dof)


def student_curvature(chi2: Array, weight: Array, dof: float) -> Array:
    """What Newton's matrix lacks against the weighted one, per outer product of an observation's weighted residual.

    The loss bends less along the residual than across it, and beyond sqrt(dof) backwards: the correction of Triggs et
    al. 2000, section 4.3, limited so that a tenth of the weight remains and the matrix stays positive.
    """
    return weight * np.minimum(2 * weight / dof, _MOST_BENT / np.maximum(chi2, 1e-300))


@lru_cache
def student_covariance_factor(dof: float, leverage: float) -> float:
    """What multiplies the inverse of the weighted information so that it is the covariance under normal noise.

    For observations of two dimensions, with m chi-square of two degrees and w its weight: (E[w^2 m] / 2) /
    E[w + w' m]^2 (Huber and Ronchetti 2009, chapter 8) times E[w] as the fit sees it: its residuals are shorter than
    the noise by the share of the data that the parameters took, `leverage`. By Gauss-Laguerre quadrature over m / 2.
    """
    half_chi2, probability = np.polynomial.laguerre.laggauss(_NODES)
    weight = student_weight(2 * half_chi2, dof)
    spread = probability @ (weight * weight * half_chi2)
    slope = probability @ (weight * weight)  # w + w' m = w^2 for these weights
    seen = probability @ student_weight(2 * half_chi2 * (1 - leverage), dof)
    return float(spread * seen / slope**2)
