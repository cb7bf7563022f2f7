"""Which landmarks of a map are confirmed, and which stay tentative: seen too seldom, or misreadings of others."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.mapping.config import BuildMapConfig

Array = NDArray[np.float64]

# Two landmarks nearer than this squared Mahalanobis distance may be one: 99 % of chi-square with 2 degrees of freedom.
_SAME_PLACE = 9.21


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
