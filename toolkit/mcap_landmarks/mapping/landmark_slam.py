"""The default way to build a map: a submap of each log, all merged, then poses and landmarks solved together."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.mapping.agreement import disagreeing
from mcap_landmarks.mapping.built_map import BuiltMap, LogTrajectory
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.confirmation import confirmed, stood
from mcap_landmarks.mapping.data_association import UNLABELLED
from mcap_landmarks.mapping.graph_slam import WRONG, KnownLandmarks, MapSolution, solve_map
from mcap_landmarks.mapping.groups import groups_of
from mcap_landmarks.mapping.merge_logs import MergedLandmarks, merge_logs
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.odometry_fault import odometry_fault
from mcap_landmarks.mapping.prepared_log import LogAlone, PreparedLog, each_alone, prepared
from mcap_landmarks.maps.model import LandmarkMap, MapSource

Ints = NDArray[np.int64]

# Of two logs that contradict each other none is to be believed more.
_TWO = 2
_NOTHING: Mapping[int, Sequence[LogAlone]] = {}
# Variance in m^2 that keeps rounding from making a covariance negative: a hundredth of a millimetre.
_ROUNDING_M2 = 1e-10


def solve_jointly(
    logs: Sequence[LogObservations],
    prior: LandmarkMap | None,
    config: BuildMapConfig,
    alone: Mapping[int, Sequence[LogAlone]] = _NOTHING,
) -> BuiltMap:
    """One map of all logs, on top of `prior` where there is one, and each log's trajectory in it.

    A log that saw nothing, cannot be laid on the others or disagrees with them is left out where at least two others
    (or a prior and one) agree. The order of the logs does not matter; without a prior the frame is that of
    the log with most firm landmarks (`merge_logs`). `alone` has what `each_alone` found of some logs, by their rows.

    Raises:
        MapError: nothing is left to make a map of, or the solver did not converge.
    """
    excluded = _seen_nothing(logs)
    _check_left(excluded, len(logs) - len(excluded), prior)
    names = sorted({name for log in logs for name in log.classes} | set(prior.classes if prior else ()))
    parts, failed = _prepared(logs, excluded, names, config, alone)
    excluded |= failed
    while True:
        parts = [part for part in parts if part.row not in excluded]
        _check_left(excluded, _count(parts), prior)
        joined, merged = _merged(parts, names, prior, config)
        excluded |= _not_laid(parts, merged)
        _check_left(excluded, _count(joined), prior)
        known = _known(prior, config)
        solution = solve_map([part.observed for part in joined], config, known, [part.alone for part in joined])
        worst = disagreeing([part.observed.landmark for part in joined], solution, known)
        if worst is None or len(logs) == 1:
            break
        excluded[joined[worst[0]].row] = worst[1]
    landmark_map = _map_of(logs, joined, merged, solution, names, prior, config)
    trajectories, left_out = _trajectories(logs, joined, solution)
    return BuiltMap(landmark_map, trajectories, solution.termination, left_out, dict(sorted(excluded.items())))


def _count(parts: Sequence[PreparedLog]) -> int:
    """The number of logs that parts are of."""
    return len({part.row for part in parts})


def _merged(
    parts: Sequence[PreparedLog], names: Sequence[str], prior: LandmarkMap | None, config: BuildMapConfig
) -> tuple[list[PreparedLog], MergedLandmarks]:
    """The parts that can be laid on each other, and on a prior, with the numbers of the landmarks of all."""
    placed = _placed(prior, names) if prior is not None else None
    merged = merge_logs([part.submap for part in parts], placed, config, _spare(parts))
    return [_joined(parts[i], merged.of_log[i]) for i in merged.order], merged


def _prepared(
    logs: Sequence[LogObservations],
    excluded: Collection[int],
    names: Sequence[str],
    config: BuildMapConfig,
    alone: Mapping[int, Sequence[LogAlone]],
) -> tuple[list[PreparedLog], dict[int, str]]:
    """The pieces of all logs, each on its own, and why some of three logs or more are not to be used.

    They are in the order of the logs' fingerprints, so that those decide between equals.
    """
    found, failed = list[PreparedLog](), dict[int, str]()
    for i, log in enumerate(logs):
        if i in excluded:
            continue
        try:
            parts = prepared(i, log, alone.get(i) or each_alone(log, config), names)
        except (MapError, RuntimeError) as error:  # what the sparse solver raises, too
            if len(logs) == 1:
                raise
            failed[i] = f"cannot be mapped: {error}"
            continue
        fault = odometry_fault(parts[0].observed, parts[0].alone.state.poses)
        if fault and len(logs) > _TWO:
            failed[i] = fault
        found += parts
    return sorted(found, key=lambda part: part.log.fingerprint), failed


def _joined(part: PreparedLog, of_log: Ints | None) -> PreparedLog:
    """A log with the numbers of the map of all logs."""
    assert of_log is not None  # noqa: S101 - only logs that were laid on the map are asked for
    observed = replace(part.observed, landmark=of_log[part.observed.landmark])
    number = np.where(part.submap.landmark == UNLABELLED, UNLABELLED, of_log[part.submap.landmark])
    alone = replace(part.alone, numbers=of_log[part.alone.numbers])
    return replace(part, submap=replace(part.submap, landmark=number), observed=observed, alone=alone)


def _not_laid(parts: Sequence[PreparedLog], merged: MergedLandmarks) -> dict[int, str]:
    """Why logs of which no part could be laid on the others are not in the map."""
    laid = {parts[i].row for i in merged.order}
    reasons = dict[int, str]()
    for i, reason in merged.reasons.items():
        if parts[i].row not in laid:
            reasons.setdefault(parts[i].row, f"cannot be laid on the rest of the map: {reason}")
    return reasons


def _check_left(excluded: Mapping[int, str], left: int, prior: LandmarkMap | None) -> None:
    """Refuse a map of one log of several, none of which would be believed more than another.

    Raises:
        MapError: as it says.
    """
    if excluded and left < (_TWO if prior is None else 1):
        told = "; ".join(f"log {i + 1} {reason}" for i, reason in sorted(excluded.items()))
        raise MapError(f"{told}; leave it out, or add a log that overlaps with all")


def _spare(parts: Sequence[PreparedLog]) -> list[int]:
    """The rows of parts that may be left out: of a log whose odometry began anew all but the first."""
    return [i for i in range(1, len(parts)) if parts[i].row == parts[i - 1].row]


def _trajectories(
    logs: Sequence[LogObservations], laid: Sequence[PreparedLog], solution: MapSolution
) -> tuple[list[LogTrajectory | None], tuple[int, ...]]:
    """Each log's trajectory, of its parts that were laid by time, and the number of its other bundles."""
    found, left_out = list[LogTrajectory | None](), list[int]()
    for i, log in enumerate(logs):
        own = [(part.log, poses) for part, poses in zip(laid, solution.trajectories, strict=True) if part.row == i]
        if not own:
            found.append(None)
            left_out.append(0)
            continue
        own.sort(key=lambda one: int(one[0].stamps_ns[0]))
        stamps_ns = np.concatenate([part.stamps_ns for part, _ in own])
        log_times_ns = np.concatenate([part.log_times_ns for part, _ in own])
        found.append(LogTrajectory(stamps_ns, log_times_ns, np.concatenate([poses for _, poses in own])))
        left_out.append(len(log.stamps_ns) - len(stamps_ns))
    return found, tuple(left_out)


def _seen_nothing(logs: Sequence[LogObservations]) -> dict[int, str]:
    """The logs that saw nothing, and why."""
    found = {}
    for i, log in enumerate(logs):
        if not len(log.bundle):
            why = ", ".join(f"{count} {reason}" for reason, count in sorted(log.dropped.items()))
            nothing = "holds no object in any bundle with odometry that could be a landmark"
            found[i] = nothing + (f" ({why})" if why else "")
    return found


def _placed(prior: LandmarkMap, names: Sequence[str]) -> tuple[Ints, Array]:
    """Class ids (Q,) and positions (Q, 2) of a map's landmarks."""
    return np.array([names.index(name) for name in prior.classes], dtype=np.int64), prior.positions_xy


def _known(prior: LandmarkMap | None, config: BuildMapConfig) -> KnownLandmarks | None:
    if prior is None:
        return None
    unknown: NDArray[np.bool_] = np.logical_not(prior.covariances.any(axis=(1, 2)))
    covariances = np.where(unknown[:, None, None], config.range_sigma_m**2 * np.eye(2), prior.covariances)
    return KnownLandmarks(np.arange(len(prior)), prior.positions_xy, covariances)


def _map_of(
    logs: Sequence[LogObservations],
    laid: Sequence[PreparedLog],
    merged: MergedLandmarks,
    solution: MapSolution,
    names: Sequence[str],
    prior: LandmarkMap | None,
    config: BuildMapConfig,
) -> LandmarkMap:
    """The solved landmarks with how often, how large and in which groups they were seen."""
    radii, measured, used, fitting = _seen(laid, len(merged.class_ids), solution)
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
        groups_of([part.log for part in laid], [part.submap.landmark for part in laid], solution.trajectories, name_of),
        _sources(logs, used, prior),
        prior.frame if prior else "map",
    )


def _seen(
    laid: Sequence[PreparedLog], landmarks: int, solution: MapSolution
) -> tuple[Array, Ints, Counter[int], list[tuple[Ints, Ints]]]:
    """Of the observations that fit: radii, summed by landmark, and their counts; bundles by log; numbers and times."""
    radii, measured = np.zeros(landmarks), np.zeros(landmarks, dtype=np.int64)
    used, fitting = Counter[int](), list[tuple[Ints, Ints]]()
    for part, weight in zip(laid, solution.weights, strict=True):
        log, number = part.log, part.submap.landmark
        seen = np.flatnonzero(number != UNLABELLED)
        fits = seen[weight > WRONG]
        fitting.append((number[fits], log.stamps_ns[log.bundle[fits]]))
        sized = fits[log.radii_m[fits] > 0]
        np.add.at(radii, number[sized], log.radii_m[sized])
        np.add.at(measured, number[sized], 1)
        used[part.row] += len(np.unique(log.bundle[fits]))
    return radii, measured, used, fitting


def _sources(
    logs: Sequence[LogObservations], used: Mapping[int, int], prior: LandmarkMap | None
) -> tuple[MapSource, ...]:
    """What the map is made from."""
    rows = sorted(used, key=lambda i: (logs[i].fingerprint, i))
    own = [MapSource("recording", logs[i].fingerprint, logs[i].bundles, used[i]) for i in rows]
    return (*(prior.sources if prior else ()), *own)


def _definite(covariances: Array) -> Array:
    """Covariances made symmetric and kept from rounding to something negative."""
    symmetric: Array = (covariances + covariances.swapaxes(1, 2)) / 2 + _ROUNDING_M2 * np.eye(2)
    return symmetric
