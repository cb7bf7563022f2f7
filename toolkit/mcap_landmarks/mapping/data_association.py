"""Which observations show the same landmark, while a robot with drifting odometry passes many that look alike.

An EKF over the robot's pose and every landmark (Dissanayake et al. 2001) keeps the covariances that gates need: small
towards what was just seen, wide towards what was left long ago. Only labels are taken from it; the graph does the rest.

Its errors are right-invariant (Barrau and Bonnabel 2015; for SLAM Zhang et al. 2017): those of a rotation of everything
about the origin, then of shifts of robot and landmarks. Jacobians of observations then hold no estimate, so the filter
cannot take its own changes of mind for knowledge of the heading, which makes the common EKF far too sure (Huang et al.
2010): at a place seen again after a long loop it would not recognise anything.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, between, compose, rotation, transform_points

UNLABELLED = -1
# Stands for infinity among distances, which the assignment cannot take.
_FAR = 1e9
# A pair beyond the gate costs as much as ten at it, so that one more pair within it is worth more than closer ones.
_BEYOND_GATE = 10
# Pairs of one bundle fit together unless right ones would do so worse in one of a thousand bundles, as the gate has it.
_JOINT_P = 0.001
# Log density of an object that was not foreseen: it may be anywhere on the 100 m by 100 m around the robot, and sensors
# reach no further. Every assumption pays it for each landmark once, so its size hardly matters.
_ANYWHERE = -math.log(100.0 * 100.0)


@dataclass(frozen=True, slots=True)
class Gates:
    """Squared Mahalanobis distances (2 degrees of freedom): below `same` it may be the landmark, above `new` it is not.

    Between the two an observation is evidence for neither and stays unlabelled. The right landmark is beyond `same`
    once in 1,000 observations; beyond `new` once in 10,000 even if the covariances are half of what they should be.
    """

    same: float = float(chdtri(2, 0.001))
    new: float = 2 * float(chdtri(2, 0.0001))


class LandmarkFilter:
    """EKF of one robot: state pose and landmarks, in the frame of its odometry.

    `mean` (3 + 2 L,) holds x, y, heading and the landmarks. `covariance` is that of the right-invariant errors in the
    same order: a heading error turns all of them about the origin, the others are shifts.
    """

    def __init__(self, start: Array, gates: Gates) -> None:
        self.mean: Array = np.array(start, dtype=np.float64)
        self.covariance: Array = np.zeros((3, 3))
        self.class_ids: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.log_evidence = 0.0
        self._gates = gates

    def move(self, step: Array, step_covariance: Array) -> None:
        """Follow the odometry's step (3,) in the base frame, with covariance (3, 3)."""
        turn = rotation(self.mean[2])
        self.mean[:3] = compose(self.mean[:3], step)
        noise = np.zeros((len(self.mean), 3))
        noise[:, 2] = -self._turned_about_origin()
        noise[:2, :2], noise[2, 2] = turn, 1.0
        self.covariance += noise @ step_covariance @ noise.T

    def _turned_about_origin(self) -> Array:
        """How robot and landmarks move (3 + 2 L,) per radian by which all turn about the origin; 0 for the heading."""
        moved = np.empty_like(self.mean)
        moved[0], moved[1], moved[2] = -self.mean[1], self.mean[0], 0.0
        moved[3::2], moved[4::2] = -self.mean[4::2], self.mean[3::2]
        return moved

    def observe(self, class_ids: NDArray[np.int64], points_xy: Array, covariances: Array) -> NDArray[np.int64]:
        """Label (K,) each object of one bundle with a landmark's number, new ones included; learn from it.

        class_ids (K,) are numbers of classes, points_xy (K, 2) and covariances (K, 2, 2) are in the base frame.
        """
        labels = np.full(len(class_ids), UNLABELLED, dtype=np.int64)
        distances = np.full((len(class_ids), len(self.class_ids)), _FAR)
        for i, (class_id, point, covariance) in enumerate(zip(class_ids, points_xy, covariances, strict=True)):
            candidates = np.flatnonzero(self.class_ids == class_id)
            if len(candidates):
                distances[i, candidates] = self._distances(candidates, point, covariance)
        rows, columns = self._assign(distances)
        rows, columns = self._jointly(rows, columns, points_xy, covariances)
        labels[rows] = columns
        if len(rows):
            self._update(columns, points_xy[rows], covariances[rows])
        self.log_evidence += _ANYWHERE * (len(class_ids) - len(rows))
        fresh = (labels == UNLABELLED) & (distances.min(axis=1, initial=_FAR) > self._gates.new)
        for row in np.flatnonzero(fresh):
            labels[row] = self._insert(int(class_ids[row]), points_xy[row], covariances[row])
        return labels

    def _distances(self, candidates: NDArray[np.int64], point: Array, covariance: Array) -> Array:
        """Squared Mahalanobis distance (C,) of one observation to each of C landmarks."""
        own = 3 + 2 * candidates[:, None] + np.arange(2)
        cross, robot = self.covariance[:2][:, own], self.covariance[:2, :2]
        state = robot + self.covariance[own[:, :, None], own[:, None, :]]
        state = state - cross.transpose(1, 0, 2) - cross.transpose(1, 2, 0)
        back = rotation(self.mean[2]).T
        spread = back @ state @ back.T + covariance
        miss = point - (self.mean[own] - self.mean[:2]) @ back.T
        squared: Array = np.einsum("ci,ci->c", miss, np.linalg.solve(spread, miss[..., None])[..., 0])
        return squared

    def _assign(self, distances: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """One landmark per object and one object per landmark, as many as the gate lets, with the least total.

        Global nearest neighbour: the assignment problem of Kuhn (1955) and Munkres (1957).
        """
        if not distances.size:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        rows, columns = linear_sum_assignment(np.minimum(distances, _BEYOND_GATE * self._gates.same))
        keep = distances[rows, columns] <= self._gates.same
        return rows[keep], columns[keep]

    def _jointly(
        self, rows: NDArray[np.int64], columns: NDArray[np.int64], points_xy: Array, covariances: Array
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The pairs that fit together (joint compatibility, Neira and Tardos 2001).

        Until all do, the one leaves that spoils the fit most: iterated data snooping (Baarda 1968).
        """
        while len(rows) > 1:
            miss, jacobian, noise = self._stack(columns, points_xy[rows], covariances[rows])
            spread = jacobian @ self.covariance @ jacobian.T + noise
            solved = np.linalg.solve(spread, miss)
            if miss @ solved <= chdtri(len(miss), _JOINT_P):
                break
            worst = int(np.argmax(_saved_by_leaving_out(solved, np.linalg.inv(spread))))
            rows, columns = np.delete(rows, worst), np.delete(columns, worst)
        return rows, columns

    def _stack(self, landmarks: NDArray[np.int64], points_xy: Array, covariances: Array) -> tuple[Array, Array, Array]:
        k = len(landmarks)
        back = rotation(self.mean[2]).T
        jacobian, noise = np.zeros((2 * k, len(self.mean))), np.zeros((2 * k, 2 * k))
        own = 3 + 2 * landmarks[:, None] + np.arange(2)
        for i, columns in enumerate(own):
            part = slice(2 * i, 2 * i + 2)
            jacobian[part, :2], jacobian[part, columns] = -back, back
            noise[part, part] = covariances[i]
        miss = points_xy - (self.mean[own] - self.mean[:2]) @ back.T
        return miss.ravel(), jacobian, noise

    def _update(self, landmarks: NDArray[np.int64], points_xy: Array, covariances: Array) -> None:
        miss, jacobian, noise = self._stack(landmarks, points_xy, covariances)
        cross = self.covariance @ jacobian.T
        spread = jacobian @ cross + noise
        squared = float(miss @ np.linalg.solve(spread, miss))
        self.log_evidence -= (squared + float(np.linalg.slogdet(spread)[1]) + len(miss) * math.log(2 * math.pi)) / 2
        gain = np.linalg.solve(spread, cross.T).T
        self._change(gain @ miss)
        self.covariance = self.covariance - gain @ cross.T
        self.covariance = (self.covariance + self.covariance.T) / 2

    def _change(self, error: Array) -> None:
        """Put right an error (3 + 2 L,): all turns by its heading's part, each shifts by its own."""
        turned = rotation(error[2])
        shift = se2.exp([1.0, 0.0, error[2]])[:2]
        along = np.array([[shift[0], -shift[1]], [shift[1], shift[0]]])
        self.mean[:2] = turned @ self.mean[:2] + along @ error[:2]
        self.mean[2] = wrap(self.mean[2] + error[2])
        landmarks = self.mean[3:].reshape(-1, 2) @ turned.T + error[3:].reshape(-1, 2) @ along.T
        self.mean[3:] = landmarks.ravel()

    def _insert(self, class_id: int, point: Array, covariance: Array) -> int:
        n, turn = len(self.mean), rotation(self.mean[2])
        grown = np.zeros((n + 2, n + 2))
        grown[:n, :n] = self.covariance
        grown[n:, :n], grown[:n, n:] = self.covariance[:2], self.covariance[:, :2]
        grown[n:, n:] = self.covariance[:2, :2] + turn @ covariance @ turn.T
        self.mean = np.concatenate([self.mean, transform_points(self.mean[:3], point)])
        self.covariance = grown
        self.class_ids = np.append(self.class_ids, class_id)
        return len(self.class_ids) - 1


def _saved_by_leaving_out(solved: NDArray[np.floating], inverse: NDArray[np.floating]) -> Array:
    """How much the squared distance falls (K,) if one of K pairs is left out: its part of S^-1 m, over that of S^-1.

    Baarda's (1968) test statistic, of two numbers at once.
    """
    parts = solved.reshape(-1, 2)
    k = np.arange(len(parts))
    blocks = inverse.reshape(len(parts), 2, len(parts), 2)[k, :, k, :]
    saved: Array = np.einsum("ki,ki->k", parts, np.linalg.solve(blocks, parts[..., None])[..., 0])
    return saved


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Landmark number (N,) per observation, `UNLABELLED` where unclear; the filter's poses (T, 3).

    `log_evidence` is the log density of all observations given the noise that was assumed, as the sum of those of their
    innovations (prediction error decomposition, Schweppe 1965): the higher, the better the assumption.
    """

    landmark: NDArray[np.int64]
    poses: Array
    log_evidence: float


def label_observations(
    odom_from_base: Array,
    step_covariances: Array,
    bundle: NDArray[np.int64],
    class_ids: NDArray[np.int64],
    points_xy: Array,
    covariances: Array,
    gates: Gates = Gates(),
) -> Labels:
    """Label each of N observations made along T bundles with a landmark's number.

    odom_from_base (T, 3) with covariances (T - 1, 3, 3) of the steps between, in the base frame of each step's start;
    `bundle` (N,) rises and says in which of T each was seen; class_ids (N,) are class numbers; points_xy (N, 2) and
    covariances (N, 2, 2) are in the base frame.
    """
    state = LandmarkFilter(odom_from_base[0], gates)
    steps = between(odom_from_base[:-1], odom_from_base[1:])
    bounds = np.searchsorted(bundle, np.arange(len(odom_from_base) + 1))
    labels = np.full(len(bundle), UNLABELLED, dtype=np.int64)
    poses = np.empty((len(odom_from_base), 3))
    for t in range(len(odom_from_base)):
        if t:
            state.move(steps[t - 1], step_covariances[t - 1])
        rows = slice(bounds[t], bounds[t + 1])
        if bounds[t] < bounds[t + 1]:
            labels[rows] = state.observe(class_ids[rows], points_xy[rows], covariances[rows])
        poses[t] = state.mean[:3]
    return Labels(labels, poses, state.log_evidence)
