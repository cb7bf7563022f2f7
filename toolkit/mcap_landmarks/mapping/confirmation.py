"""Which landmarks are confirmed, and which stay tentative: seen too seldom or too briefly, or misreadings of others."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import speed_mps
from mcap_landmarks.mapping.config import BuildMapConfig

Array = NDArray[np.float64]

# Two landmarks nearer than this squared Mahalanobis distance may be one: 99 % of chi-square with 2 degrees of freedom.
_SAME_PLACE = 9.21

# What was seen for less time than it takes to be so many metres farther on may only have passed by.
_FARTHER_M = 2.0


def confirmed(
    landmarks_xy: Array, covariance: Array, observations: NDArray[np.int64], config: BuildMapConfig
) -> NDArray[np.bool_]:
    """Which of L landmarks (L, 2) with covariance (L, 2, 2) have enough observations (L,) that fit them.

    Fewer than `min_sightings` are too few. One with less than `misread_share` of the observations of another that
    stands where it stands, as far as both covariances tell, is taken for a misreading of that one's class.
    """
    share = config.misread_share
    sure = observations >= config.min_sightings
    for weak in np.flatnonzero(sure & (observations < share * observations.max(initial=0))):
        rivals = np.flatnonzero(share * observations > observations[weak])
        gap = landmarks_xy[rivals] - landmarks_xy[weak]
        both = covariance[rivals] + covariance[weak]
        squared = np.einsum("ri,ri->r", gap, np.linalg.solve(both, gap[..., None])[..., 0])
        sure[weak] = bool((squared > _SAME_PLACE).all())
    return sure


def stood(classes: Sequence[str], seen: Iterable[tuple[NDArray[np.int64], NDArray[np.int64]]]) -> NDArray[np.bool_]:
    """Which of L landmarks, of classes (L,), were seen for so long that they would be elsewhere by then if they moved.

    `seen` are per log the landmarks' numbers (N,) and the times of their observations (N,) in ns. What was seen in two
    logs stood from one to the other.
    """
    span_s, logs = np.zeros(len(classes)), np.zeros(len(classes), dtype=np.int64)
    for numbers, times_ns in seen:
        first, last = np.full(len(classes), np.inf), np.full(len(classes), -np.inf)
        np.minimum.at(first, numbers, times_ns)
        np.maximum.at(last, numbers, times_ns)
        there = np.isfinite(first)
        span_s[there] += (last - first)[there] / 1e9
        logs += there
    speeds = np.array([speed_mps(name) for name in classes])
    enough: NDArray[np.bool_] = (speeds == 0) | (logs > 1) | (span_s * speeds >= _FARTHER_M)
    return enough
