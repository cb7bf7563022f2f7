"""The default way to build a map: a submap of each log, all merged, then poses and landmarks solved together."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.mapping.built_map import BuiltMap, LogTrajectory
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.confirmation import confirmed, stood
from mcap_landmarks.mapping.data_association import UNLABELLED
from mcap_landmarks.mapping.graph_slam import KnownLandmarks, MapSolution, solve_map
from mcap_landmarks.mapping.groups import groups_of
from mcap_landmarks.mapping.log_graph import LandmarkObservations
from mcap_landmarks.mapping.merge_logs import MergedLandmarks, merge_logs
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.submap import Submap, build_submap, motions_of
from mcap_landmarks.maps.model import LandmarkMap, MapSource

Ints = NDArray[np.int64]

# Below this weight the joint solution took an observation for wrong: with one degree of freedom, 3 sigmas or more.
_WRONG = 0.1
# Variance in m^2 that keeps rounding from making a covariance negative: a hundredth of a millimetre.
_ROUNDING_M2 = 1e-10


def solve_jointly(logs: Sequence[LogObservations], prior: LandmarkMap | None, config: BuildMapConfig) -> BuiltMap:
    """One map of all logs, on top of `prior` where there is one, and each log's trajectory in it.

    Raises:
        MapError: a log has nothing to map or cannot be merged with the others, or the solver did not converge.
    """
    _check_seen(logs)
    names = sorted({name for log in logs for name in log.classes} | set(prior.classes if prior else ()))
    id_of_class = {name: i for i, name in enumerate(names)}
    parts = _parts(logs)
    submaps = [build_submap(part, _ids(part, id_of_class), config) for _, part in parts]
    known = _placed(prior, id_of_class) if prior is not None else None
    merged = merge_logs(submaps, known, config, _spare(parts))
    rows = [row for row, of_log in enumerate(merged.of_log) if of_log is not None]
    laid = [parts[row] for row in rows]
    numbers = [_numbers(submaps[row], merged.of_log[row]) for row in rows]
    solution = solve_map([_labelled(*one) for one in zip(laid, numbers, strict=True)], config, _known(prior, config))
    landmark_map = _map_of(laid, numbers, merged, solution, names, prior, config)
    trajectories, left_out = _trajectories(logs, laid, solution)
    return BuiltMap(landmark_map, trajectories, solution.termination, left_out)


def _parts(logs: Sequence[LogObservations]) -> list[tuple[int, LogObservations]]:
    """The pieces of all logs, each with the number of its log."""
    return [(i, part) for i, log in enumerate(logs) for part in log.pieces()]


def _spare(parts: Sequence[tuple[int, LogObservations]]) -> list[int]:
    """The rows of parts that may be left out: of a log whose odometry began anew all but the first."""
    return [row for row in range(1, len(parts)) if parts[row][0] == parts[row - 1][0]]


def _ids(log: LogObservations, id_of_class: Mapping[str, int]) -> Ints:
    """The class ids (N,) of a log's objects."""
    return np.array([id_of_class[name] for name in log.classes], dtype=np.int64)


def _trajectories(
    logs: Sequence[LogObservations], laid: Sequence[tuple[int, LogObservations]], solution: MapSolution
) -> tuple[list[LogTrajectory], tuple[int, ...]]:
    """Each log's trajectory, of its parts that were laid by time, and the number of its other bundles."""
    found, left_out = list[LogTrajectory](), list[int]()
    for i, log in enumerate(logs):
        own = [(part, poses) for (k, part), poses in zip(laid, solution.trajectories, strict=True) if k == i]
        own.sort(key=lambda one: int(one[0].stamps_ns[0]))
        stamps_ns = np.concatenate([part.stamps_ns for part, _ in own])
        log_times_ns = np.concatenate([part.log_times_ns for part, _ in own])
        found.append(LogTrajectory(stamps_ns, log_times_ns, np.concatenate([poses for _, poses in own])))
        left_out.append(len(log.stamps_ns) - len(stamps_ns))
    return found, tuple(left_out)


def _check_seen(logs: Sequence[LogObservations]) -> None:
    """Refuse logs that saw nothing.

    Raises:
        MapError: as it says.
    """
    empty = [i for i, log in enumerate(logs) if not len(log.bundle)]
    if empty:
        dropped = sum((Counter(logs[i].dropped) for i in empty), Counter[str]())
        why = f" ({', '.join(f'{count} {reason}' for reason, count in sorted(dropped.items()))})" if dropped else ""
        numbers = ", ".join(str(i + 1) for i in empty)
        raise MapError(
            f"log {numbers} holds no object in any bundle with odometry that could be a landmark{why}; leave it out"
        )


def _placed(prior: LandmarkMap, id_of_class: Mapping[str, int]) -> tuple[Ints, Array]:
    """Class ids (Q,) and positions (Q, 2) of a map's landmarks."""
    return np.array([id_of_class[name] for name in prior.classes], dtype=np.int64), prior.positions_xy


def _numbers(submap: Submap, of_log: Ints | None) -> Ints:
    """The number (N,) of each observation's landmark in the map of all logs."""
    assert of_log is not None  # noqa: S101 - only logs that were laid on the map are asked for
    return np.where(submap.landmark == UNLABELLED, UNLABELLED, of_log[submap.landmark])


def _labelled(part: tuple[int, LogObservations], number: Ints) -> LandmarkObservations:
    log = part[1]
    seen = np.flatnonzero(number != UNLABELLED)
    polar = polar_from_points(log.points_xy[seen], log.covariances[seen])
    return LandmarkObservations(log.odom_from_base[0], motions_of(log), log.bundle[seen], number[seen], *polar)


def _known(prior: LandmarkMap | None, config: BuildMapConfig) -> KnownLandmarks | None:
    if prior is None:
        return None
    unknown: NDArray[np.bool_] = np.logical_not(prior.covariances.any(axis=(1, 2)))
    covariances = np.where(unknown[:, None, None], config.range_sigma_m**2 * np.eye(2), prior.covariances)
    return KnownLandmarks(np.arange(len(prior)), prior.positions_xy, covariances)


def _map_of(
    laid: Sequence[tuple[int, LogObservations]],
    numbers: Sequence[Ints],
    merged: MergedLandmarks,
    solution: MapSolution,
    names: Sequence[str],
    prior: LandmarkMap | None,
    config: BuildMapConfig,
) -> LandmarkMap:
    """The solved landmarks with how often, how large and in which groups they were seen."""
    radii, measured = np.zeros(len(merged.class_ids)), np.zeros(len(merged.class_ids), dtype=np.int64)
    used, fitting = Counter[int](), list[tuple[Ints, Ints]]()
    for (i, log), number, weight in zip(laid, numbers, solution.weights, strict=True):
        seen = np.flatnonzero(number != UNLABELLED)
        fits = seen[weight > _WRONG]
        fitting.append((number[fits], log.stamps_ns[log.bundle[fits]]))
        sized = fits[log.radii_m[fits] > 0]
        np.add.at(radii, number[sized], log.radii_m[sized])
        np.add.at(measured, number[sized], 1)
        used[i] += len(np.unique(log.bundle[fits]))
    row = solution.number
    ids = [f"l{number + 1}" for number in row]
    radius = radii[row] / np.maximum(measured[row], 1)
    observations = solution.observations.copy()
    if prior is not None:
        ids = [*prior.ids, *(name for name in ids[len(prior) :])]
        observations[: len(prior)] += prior.sightings
        radius[: len(prior)] = np.where(measured[: len(prior)] > 0, radius[: len(prior)], prior.radii_m)
    covariances = _definite(solution.covariance)
    sure = confirmed(solution.landmarks_xy, covariances, observations, config)
    sure &= stood([names[class_id] for class_id in merged.class_ids], fitting)[row]
    if prior is not None:
        sure[: len(prior)] |= ~prior.tentative
    name_of = {int(number): ids[i] for i, number in enumerate(row) if sure[i]}
    return LandmarkMap(
        tuple(ids),
        tuple(names[merged.class_ids[number]] for number in row),
        solution.landmarks_xy,
        covariances,
        radius,
        observations,
        np.logical_not(sure),
        groups_of([log for _, log in laid], numbers, solution.trajectories, name_of),
        _sources(laid, used, prior),
        prior.frame if prior else "map",
    )


def _sources(
    laid: Sequence[tuple[int, LogObservations]], used: Mapping[int, int], prior: LandmarkMap | None
) -> tuple[MapSource, ...]:
    """What the map is made from; the first part of a log counts all of its bundles."""
    wholes = dict(reversed(laid))
    own = [MapSource("recording", wholes[i].fingerprint, wholes[i].bundles, used[i]) for i in sorted(wholes)]
    return (*(prior.sources if prior else ()), *own)


def _definite(covariances: Array) -> Array:
    """Covariances made symmetric and kept from rounding to something negative."""
    symmetric: Array = (covariances + covariances.swapaxes(1, 2)) / 2 + _ROUNDING_M2 * np.eye(2)
    return symmetric
