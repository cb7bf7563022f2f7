"""Association by class alone, where a class stands for one landmark, as with numbered beacons or tags."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.maps.model import LandmarkMap


def unique_classes(landmark_map: LandmarkMap) -> dict[str, int]:
    """Row of the landmark of each class that no other confirmed landmark of the map has."""
    rows = [int(row) for row in np.flatnonzero(~landmark_map.tentative)]
    counts = Counter(landmark_map.classes[row] for row in rows)
    return {landmark_map.classes[row]: row for row in rows if counts[landmark_map.classes[row]] == 1}


def pairs_by_class(
    classes: Sequence[str], landmark_of: Mapping[str, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of objects (K,) and of landmarks (K,) that belong together; a class seen twice in one bundle is left out."""
    seen = Counter(classes)
    rows = [i for i, name in enumerate(classes) if name in landmark_of and seen[name] == 1]
    landmarks = [landmark_of[classes[i]] for i in rows]
    return np.array(rows, dtype=np.int64), np.array(landmarks, dtype=np.int64)
