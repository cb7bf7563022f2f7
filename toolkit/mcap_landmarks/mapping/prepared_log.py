"""One log on its way into a map of several: its landmarks, its graph and the noise in it, before others are known."""

from collections.abc import Sequence
from dataclasses import dataclass

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
class PreparedLog:
    """A log or a piece of one, of the log `row`: its landmarks by the numbers of its submap, and its own solution."""

    row: int
    log: LogObservations
    submap: Submap
    observed: LandmarkObservations
    alone: LogSolution


def prepare(row: int, log: LogObservations, class_ids: Ints, config: BuildMapConfig) -> PreparedLog:
    """A log, of objects of classes with the ids class_ids (N,), as far as it goes alone.

    Raises:
        MapError: not one landmark can be told from others.
        RuntimeError: what was seen does not determine its landmarks.
    """
    submap = build_submap(log, class_ids, config)
    seen = np.flatnonzero(submap.landmark != UNLABELLED)
    if not len(seen):
        raise MapError("a log without a single observation of a landmark cannot be mapped; leave it out")
    polar = polar_from_points(log.points_xy[seen], log.covariances[seen])
    landmark, bundle = submap.landmark[seen], log.bundle[seen]
    observed = LandmarkObservations(log.odom_from_base[0], motions_of(log), bundle, landmark, *polar)
    return PreparedLog(row, log, submap, observed, solve_with_its_noise(observed, config))


def class_ids_of(log: LogObservations, names: Sequence[str]) -> Ints:
    """The class ids (N,) of a log's objects, which are rows of `names`."""
    id_of_class = {name: i for i, name in enumerate(names)}
    return np.array([id_of_class[name] for name in log.classes], dtype=np.int64)
