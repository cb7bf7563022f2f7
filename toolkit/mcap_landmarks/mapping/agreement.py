"""Which of several logs in one solution does not see what the others saw."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.mapping.graph_slam import WRONG, KnownLandmarks, MapSolution

Ints = NDArray[np.int64]

# A log agrees with the others if so many of its observations of what they saw, too, are not taken for wrong. Of logs of
# made-up drives through one world 0.97 are, of one through another world that three landmarks tie to it 0.47; below
# half no robust estimate can tell which of the two is right (the breakdown point, Huber and Ronchetti 2009).
_AGREEING = 0.6


def disagreeing(
    landmarks: Sequence[Ints], solution: MapSolution, known: KnownLandmarks | None
) -> tuple[int, str] | None:
    """The log that disagrees most with the others, and how much in words; None if none does.

    `landmarks` are per log the numbers (M,) of the landmarks that it observed.
    """
    logs = np.zeros(int(solution.number.max()) + 1, dtype=np.int64)
    for numbers in landmarks:
        logs[np.unique(numbers)] += 1
    if known is not None:
        logs[known.number] += 1
    pairs = zip(landmarks, solution.weights, strict=True)
    fits = [weight[logs[numbers] > 1] > WRONG for numbers, weight in pairs]
    shares = np.array([one.mean() if len(one) else 1.0 for one in fits])
    worst = int(np.argmin(shares))
    if shares[worst] >= _AGREEING:
        return None
    return worst, f"disagrees with the others: {1 - shares[worst]:.0%} of its observations of their landmarks are wrong"
