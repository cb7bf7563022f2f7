"""Bring what separate logs mapped into one frame, by the landmarks that they share."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation import procrustes
from mcap_landmarks.geometry import se2

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Pairs that are tried: if just half of the points fit, a quarter of the pairs do, so some of 500 drawn ones always.
_PAIRS = 500
# Points within so many times the median distance fit: 99.8 % of those whose errors are normal (Rayleigh distribution).
_FITTING = 3.0


def align(points_xy: Array, onto_xy: Array, seed: int = 0) -> Array:
    """Transform (3,) that brings points (N, 2) onto others (N, 2), N >= 2; right if two more than half of them fit.

    Least median of squares (Rousseeuw 1984): of transforms by two points each, the one with the least median distance;
    then the best one (Procrustes; Umeyama 1991) of all points within three times that.
    """
    first, second = np.triu_indices(len(points_xy), 1)
    if len(first) > _PAIRS:
        drawn = np.random.default_rng(seed).choice(len(first), _PAIRS, replace=False)
        first, second = first[drawn], second[drawn]
    pairs = np.stack([first, second])
    tried = _fit(points_xy[pairs], onto_xy[pairs])
    moved = se2.transform_points(tried[:, None], points_xy)
    distance = np.linalg.norm(moved - onto_xy, axis=2)
    # With the two that made the transform left in, the median must look beyond them.
    middle = np.sort(distance, axis=1)[:, min(len(points_xy) // 2 + 1, len(points_xy) - 1)]
    best = int(np.argmin(middle))
    near = distance[best] <= max(_FITTING * middle[best], 1e-9)
    return np.asarray(_fit(points_xy[near][:, None], onto_xy[near][:, None])[0])


def into_one_frame(
    alone: list[tuple[Ints, Array]], known: tuple[Ints, Array] | None
) -> tuple[list[Array], Ints, Array]:
    """Transforms (3,) of each log's landmarks (numbers (L,), positions (L, 2)) into one frame, and all of them in it.

    That frame is the one of the landmarks `known` beforehand, else the first log's. Next comes always the log that
    shares most landmarks with what is there already.

    Raises:
        MapError: a log shares fewer than two landmarks with the rest.
    """
    places = [_by_number(*one) for one in alone]
    transforms: dict[int, Array] = {} if known else {0: np.zeros(3)}
    there = _by_number(*known) if known else dict(places[0])
    while len(transforms) < len(alone):
        shared = {i: [n for n in place if n in there] for i, place in enumerate(places) if i not in transforms}
        best = max(shared, key=lambda i: len(shared[i]))
        if len(shared[best]) < 2:
            raise MapError(
                f"log {best + 1} shares {len(shared[best])} landmarks with the others, but one frame takes two; "
                "map it on its own or add a log that overlaps with both"
            )
        transforms[best] = align(_at(places[best], shared[best]), _at(there, shared[best]))
        for number, point in places[best].items():
            there.setdefault(number, se2.transform_points(transforms[best], point))
    numbers = sorted(there)
    return [transforms[i] for i in range(len(alone))], np.array(numbers, dtype=np.int64), _at(there, numbers)


def _by_number(numbers: Ints, positions_xy: Array) -> dict[int, Array]:
    return dict(zip(numbers.tolist(), positions_xy, strict=True))


def _at(places: dict[int, Array], numbers: list[int]) -> Array:
    """Positions (N, 2) of the landmarks with these numbers."""
    return np.array([places[n] for n in numbers]).reshape(-1, 2)


def _fit(points_xy: Array, onto_xy: Array) -> Array:
    """Transforms (B, 3) that bring points (K, B, 2) onto others (K, B, 2)."""
    weight = np.ones(points_xy.shape[:2])
    x, y, c, s = procrustes.fit(onto_xy[..., 0], onto_xy[..., 1], points_xy[..., 0], points_xy[..., 1], weight)
    return np.stack([x, y, np.arctan2(s, c)], axis=-1)
