"""Whether a log's odometry measures ways and turns as they are, by where its landmarks say that it was."""

import numpy as np

from mcap_landmarks.estimation.odometry import dead_reckoning
from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.mapping.log_graph import LandmarkObservations

# Between the poses that are compared odometry came so far, or turned so much: a hundred times and ten times what
# landmarks leave unknown of a pose.
_STRETCH_M, _STRETCH_RAD = 1.0, 0.3
# Fewer stretches say nothing.
_FEWEST = 5
# Wheels that wear or slip measure ways some hundredths wrong, skid steering turns by up to half (Mandow et al. 2007);
# odometry of the other hand, in other units or of another robot is beyond.
_WAY, _TURN = 0.15, 0.6


def odometry_fault(log: LandmarkObservations, poses: Array) -> str:
    """What is wrong with the odometry of a log whose poses (N, 3) its landmarks tell, in words; empty if nothing is."""
    odometry, solved = _between(log, poses, np.cumsum(log.motions.distance_m), _STRETCH_M)
    way, true_way = (np.hypot(one[:, 0], one[:, 1]) for one in (odometry, solved))
    far = true_way >= _STRETCH_M / 2
    if far.sum() >= _FEWEST:
        scale = float(np.median(way[far] / true_way[far]))
        if abs(np.log(max(scale, 1e-9))) > np.log(1 + _WAY):
            return f"its odometry measures ways {scale:.2f} times as long as they are by its landmarks"
    odometry, solved = _between(log, poses, np.cumsum(log.motions.turn_rad), _STRETCH_RAD)
    turned = np.abs(solved[:, 2]) >= _STRETCH_RAD / 2
    if turned.sum() >= _FEWEST:
        scale = float(np.median(odometry[turned, 2] / solved[turned, 2]))
        if abs(scale - 1) > _TURN:
            return f"its odometry measures turns {scale:.2f} times as large as they are by its landmarks"
    return ""


def _between(log: LandmarkObservations, poses: Array, came: Array, stretch: float) -> tuple[Array, Array]:
    """Motions (S, 3) as odometry and as the poses have them, between poses that `came` (N - 1,) a stretch farther."""
    steps, last = [0], 0.0
    for i, at in enumerate(came.tolist(), 1):
        if at - last >= stretch:
            steps.append(i)
            last = at
    measured, solved = dead_reckoning(log.start, log.motions)[steps], poses[steps]
    return se2.between(measured[:-1], measured[1:]), se2.between(solved[:-1], solved[1:])
