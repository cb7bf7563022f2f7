"""One log on its way into a map of several: its landmarks, its graph and the noise in it, before others are known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.data_association import UNLABELLED
from mcap_landmarks.mapping.log_graph import LandmarkObservations
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.submap import Submap, build_submap, motions_of
from mcap_landmarks.mapping.variance_components import LogSolution, solve_with_its_noise

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LogAlone:
    """What a log, or a piece of one, tells before others are known: its submap, and its own solution."""

    submap: Submap
    solution: LogSolution


@dataclass(frozen=True, slots=True, eq=False)
class PreparedLog:
    """A log or a piece of one, of the log `row`: its landmarks by the numbers of its submap, and its own solution."""

    row: int
    log: LogObservations
    submap: Submap
    observed: LandmarkObservations
    alone: LogSolution


def each_alone(log: LogObservations, config: BuildMapConfig) -> tuple[LogAlone, ...]:
    """What each piece of a log tells alone; classes have the ids that they have among those of the log, sorted.

    That takes nearly all of the time of a map of many logs, and no two of them have anything to do with each other.

    Raises:
        MapError: of one not a single landmark can be told from others.
        RuntimeError: what was seen does not determine its landmarks.
    """
    id_of_class = {name: i for i, name in enumerate(_names(log))}
    return tuple(
        _alone(piece, np.array([id_of_class[name] for name in piece.classes], dtype=np.int64), config)
        for piece in log.pieces()
    )


def _alone(log: LogObservations, class_ids: Ints, config: BuildMapConfig) -> LogAlone:
    submap = build_submap(log, class_ids, config)
    if (submap.landmark == UNLABELLED).all():
        raise MapError("a log without a single observation of a landmark cannot be mapped; leave it out")
    return LogAlone(submap, solve_with_its_noise(_observed(log, submap), config))


def prepared(row: int, log: LogObservations, alone: Sequence[LogAlone], names: Sequence[str]) -> list[PreparedLog]:
    """The pieces of a log whose classes get the ids that they have among `names`."""
    ids = np.array([names.index(name) for name in _names(log)], dtype=np.int64)
    found = []
    for piece, one in zip(log.pieces(), alone, strict=True):
        submap = replace(one.submap, class_ids=ids[one.submap.class_ids])
        found.append(PreparedLog(row, piece, submap, _observed(piece, submap), one.solution))
    return found


def _names(log: LogObservations) -> list[str]:
    return sorted({*log.classes})


def _observed(log: LogObservations, submap: Submap) -> LandmarkObservations:
    """The log as the graph takes it, with the numbers of its submap."""
    seen = np.flatnonzero(submap.landmark != UNLABELLED)
    polar = polar_from_points(log.points_xy[seen], log.covariances[seen])
    landmark, bundle = submap.landmark[seen], log.bundle[seen]
    return LandmarkObservations(log.odom_from_base[0], motions_of(log), bundle, landmark, *polar)
