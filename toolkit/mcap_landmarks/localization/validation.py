"""Is a map fit to localize in, and do map and log speak of metres both?"""

from collections.abc import Sequence

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.model import LandmarkMap

# A millimetre is less than any map is good for: landmarks within it have no geometry.
_ONE_PLACE_M = 1e-3
# No sensor sees an object farther away, and no map has its landmarks farther apart: beyond, the unit is wrong.
_FARTHEST_M, _SPARSEST_M = 500.0, 200.0
# Lengths of the same things that differ by more than this, most of them and not just few, are in two units: between
# metres and millimetres are 1000, of which wrong pairs and errors do not take away a factor of five.
_OFF, _FEW = 200.0, 4


def check_map(landmark_map: LandmarkMap) -> None:
    """Refuse a map in which no pose can be found.

    Raises:
        MapError: no confirmed landmark, just one, or all in one place.
    """
    positions = landmark_map.positions_xy[~landmark_map.tentative]
    if not len(positions):
        raise MapError("the map has no confirmed landmarks; build it from a log that sees them more often")
    if len(positions) == 1:
        raise MapError("the map has one confirmed landmark; a pose needs two at least, so map more of the surroundings")
    if np.ptp(positions, axis=0).max() < _ONE_PLACE_M:
        raise MapError(
            f"all {len(positions)} landmarks of the map lie in one place; a map without geometry cannot localize, so "
            "build or import it again"
        )


def check_lengths(points_xy: Array, extent_m: tuple[float, float]) -> None:
    """Refuse the objects (K, 2) of one bundle if they cannot be in the same unit as a map.

    `extent_m`: the shortest distance between two landmarks of the map, and its diagonal.

    Raises:
        MapError: one of both is not in metres.
    """
    if len(points_xy) < 2:
        return
    apart = np.linalg.norm(points_xy[:, None] - points_xy, axis=-1)[np.triu_indices(len(points_xy), 1)]
    nearest, widest = extent_m
    far_objects = np.median(np.linalg.norm(points_xy, axis=1)) > _FARTHEST_M and apart.min() > min(widest, _FARTHEST_M)
    far_landmarks = apart.max() < nearest and nearest > _SPARSEST_M
    if far_objects or far_landmarks:
        raise MapError(
            f"objects of one bundle lie {apart.min():.3g} to {apart.max():.3g} m apart, landmarks of the map "
            f"{nearest:.3g} to {widest:.3g} m; one of them is not in metres, so convert it"
        )


def check_scale(seen_xy: Sequence[Array], mapped_xy: Sequence[Array]) -> None:
    """Refuse bundles whose objects, each (K, 2), cannot be in the same unit as their landmarks (K, 2).

    Raises:
        MapError: the distances between objects are mostly far from those between their landmarks.
    """
    ratios: list[Array] = []
    for seen, mapped in zip(seen_xy, mapped_xy, strict=True):
        lengths = np.linalg.norm(np.diff(seen, axis=0), axis=1)
        ratios.append(np.linalg.norm(np.diff(mapped, axis=0), axis=1) / np.maximum(lengths, 1e-9))
    found = np.concatenate(ratios)
    if len(found) < _FEW:
        return
    ratio = float(np.median(found))
    if not 1 / _OFF < ratio < _OFF:
        raise MapError(
            f"landmarks of the map lie {ratio:.3g} times as far apart as the same ones in the log; one of them is not "
            "in metres, so convert it"
        )
