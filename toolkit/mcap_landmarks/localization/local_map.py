"""What a robot has observed lately, as one set of objects around it: bundles brought together through odometry."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.acceptance import PairDensity
from mcap_landmarks.localization.config import LocalizeConfig

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Objects that are kept: as many as are matched of one bundle (`matching._MOST`).
_MOST = 24
# The share of an object's variance that is the same in every observation of it: shapes and sensors err alike from
# similar views, and nothing tells how much, so half.
_SYSTEMATIC = 0.5
# A stray was observed once, and not in so many bundles after over so much of the way (`evidence._SAME_VIEW_M`).
_STRAY_BUNDLES, _STRAY_M = 2, 2.0
# The share of objects that are spurious, as configured, counts like so many objects; the log's own strays do the rest.
_BELIEVED = 10.0
# An object that is one is missed in the bundle after with this probability, a spurious one always.
_MISSED = 0.25
# Weight of having observed an object often: between none, and the whole one of the rule of succession (Laplace), which
# takes observations for independent.
_OFTEN = 0.75
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


class LocalMap:
    """Objects observed over the last `length_m`, in the frame of the base as it is now, with their joint covariance.

    A Kalman filter around the robot (Castellanos et al. 2004): motion moves all objects and makes them uncertain
    together, an object observed again is a direct measurement. Half of an object's error is a bias, which is accounted
    for and not estimated, so that looking longer helps only so far.
    """

    def __init__(self, density: PairDensity, frequency: Array, length_m: float, config: LocalizeConfig) -> None:
        self._density, self._frequency, self._length_m, self._config = density, frequency, length_m, config
        self._way_m = 0.0
        self._strays = 0
        self._next = 0
        self.numbers: Ints = np.zeros(0, dtype=np.int64)
        self.points_xy: Array = np.zeros((0, 2))
        self._called: Array = np.zeros((0, len(frequency)))
        self._votes: Array = np.zeros((0, len(frequency)))
        self._white: Array = np.zeros((0, 0))
        self._bias: Array = np.zeros((0, 2, 2))
        self.observations: Ints = np.zeros(0, dtype=np.int64)
        self._observed_at_m: Array = np.zeros(0)
        self._last_bundle: Ints = np.zeros(0, dtype=np.int64)
        self._bundles = 0

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def covariance(self) -> Array:
        """Joint covariance (2N, 2N) of all points."""
        joint = self._white.copy()
        for i, bias in enumerate(self._bias):
            joint[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += bias
        return joint

    @property
    def age_m(self) -> Array:
        """How far (N,) the robot has come since it observed each object last."""
        age: Array = self._way_m - self._observed_at_m
        return age

    @property
    def probabilities(self) -> Array:
        """Likelihoods (N, C) of all that was observed of each, were it of each class, up to a factor.

        Views of one object err alike, so n of them count as the square root of n; none outweighs a class that is
        misread from everywhere.
        """
        votes = self._votes / np.sqrt(self.observations)[:, None]
        likely = np.exp(votes - votes.max(axis=1, initial=-np.inf, keepdims=True))
        likely /= likely.sum(axis=1, keepdims=True)
        floored: Array = np.maximum(likely, self._config.misread / len(self._frequency))
        return floored

    @property
    def spurious(self) -> Array:
        """Probability (N,) that each is not in the map, or no object at all: what was observed again is one.

        How much is spurious is learned from what was not observed again.
        """
        missed = self._missed()
        strays = self._strays + int(missed.sum())
        share = (_BELIEVED * self._config.spurious + strays) / (_BELIEVED + self._next)
        once = np.where(missed, share / (share + (1 - share) * _MISSED), share)
        return np.where(self.observations < 2, np.maximum(once, self._config.spurious), self._config.spurious)

    def spurious_of(self, numbers: Ints) -> Array:
        """The same (K,) of objects by their numbers."""
        place = np.searchsorted(self.numbers, numbers)
        return self.spurious[place]

    def predict(self, step: Array, step_covariance: Array, way_m: float) -> None:
        """The base moves by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it starts from."""
        self._way_m += way_m
        if not len(self):
            return
        n = len(self)
        back = se2.rotation(-step[2])
        self.points_xy = (self.points_xy - step[:2]) @ back.T
        all_back = np.kron(np.eye(n), back)
        by_step = np.empty((2 * n, 3))
        by_step[:, :2] = np.tile(-back, (n, 1))
        by_step[:, 2] = -(self.points_xy @ _TURN.T).ravel()
        self._white = all_back @ self._white @ all_back.T + by_step @ step_covariance @ by_step.T
        self._bias = back @ self._bias @ back.T
        # Where more than one landmark would fit by chance, an object has nothing left to say.
        own = self._own()
        crowd = 2 * np.pi * np.sqrt(np.maximum(np.linalg.det(own), 0)) * np.exp(self._density.log_density[-1])
        stray = (self.observations < 2) & (self._last_bundle < self._bundles - _STRAY_BUNDLES) & (self.age_m > _STRAY_M)
        self._strays += int(stray.sum())
        self._keep((self.age_m < self._length_m) & (crowd < 1) & ~stray)

    def update(self, points_xy: Array, covariances: Array, probabilities: Array) -> Ints:
        """Take in one bundle: points (K, 2), covariances (K, 2, 2), class likelihoods (K, C).

        Returns the number (K,) by which each object is known from now on. The surest go first: each one that is known
        again also tells where the others are, since odometry moved all of them wrong together.
        """
        self._bundles += 1
        numbers = np.full(len(points_xy), -1, dtype=np.int64)
        free = np.ones(len(self), dtype=np.bool_)
        while (todo := np.flatnonzero(numbers < 0)).size and free.any():
            same = self._same(points_xy[todo], covariances[todo], probabilities[todo])
            same[:, ~free] = -np.inf
            place, track = divmod(int(np.argmax(same)), len(self))
            if same[place, track] < 0:
                break
            known = int(todo[place])
            self._update_object(track, points_xy[known], covariances[known], probabilities[known])
            numbers[known] = self.numbers[track]
            free[track] = False
        for row in np.flatnonzero(numbers < 0):
            numbers[row] = self._add_object(points_xy[row], covariances[row], probabilities[row])
        newest_first = np.lexsort((-self.observations, -self._last_bundle))
        self._keep(np.isin(np.arange(len(self)), newest_first[:_MOST]))
        return numbers

    def _missed(self) -> NDArray[np.bool_]:
        """Which (N,) were observed once, and not in the bundle after."""
        return np.logical_and(self.observations < 2, self._last_bundle < self._bundles)

    def _same(self, points: Array, covariances: Array, probabilities: Array) -> Array:
        """Logarithm (K, N) of how much likelier it is that an object is one known than another one beside it.

        Nobody knows whether the bias from here is that from there, so both count.
        """
        spread = (self._own() + self._bias)[None] + covariances[:, None]
        miss = points[:, None] - self.points_xy[None]
        near = -(miss[..., None, :] @ np.linalg.solve(spread, miss[..., None]))[..., 0, 0] / 2
        near -= np.log(2 * np.pi) + np.log(np.linalg.det(spread)) / 2
        agree = (probabilities * self._frequency) @ self._called.T
        agree /= np.outer(probabilities @ self._frequency, self._called @ self._frequency)
        beside = self._density.at(np.linalg.norm(miss, axis=-1))
        # What lies beside an object that was observed so often has been observed as well.
        likely: Array = near + np.log(agree) - beside + _OFTEN * np.log1p(self.observations)
        return likely

    def _own(self) -> Array:
        """Covariance (N, 2, 2) of each point."""
        place = np.arange(len(self))
        own: Array = self._white.reshape(len(self), 2, len(self), 2)[place, :, place, :]
        return own

    def _update_object(self, track: int, point: Array, covariance: Array, probabilities: Array) -> None:
        part = slice(2 * track, 2 * track + 2)
        cross = self._white[:, part]
        gain = cross @ np.linalg.inv(cross[part] + (1 - _SYSTEMATIC) * covariance)
        self.points_xy = self.points_xy + (gain @ (point - self.points_xy[track])).reshape(-1, 2)
        self._white = self._white - gain @ cross.T
        self._white = (self._white + self._white.T) / 2
        self._bias[track] = _SYSTEMATIC * covariance
        count = self.observations[track] = self.observations[track] + 1
        self._called[track] += (probabilities - self._called[track]) / count
        self._votes[track] += np.log(probabilities)
        self._observed_at_m[track], self._last_bundle[track] = self._way_m, self._bundles

    def _add_object(self, point: Array, covariance: Array, probabilities: Array) -> int:
        n = len(self)
        grown = np.zeros((2 * n + 2, 2 * n + 2))
        grown[: 2 * n, : 2 * n] = self._white
        grown[2 * n :, 2 * n :] = (1 - _SYSTEMATIC) * covariance
        self._white = grown
        self.points_xy = np.concatenate([self.points_xy, point[None]])
        self._bias = np.concatenate([self._bias, _SYSTEMATIC * covariance[None]])
        self._called = np.concatenate([self._called, probabilities[None]])
        self._votes = np.concatenate([self._votes, np.log(probabilities)[None]])
        self.observations = np.append(self.observations, 1)
        self._observed_at_m = np.append(self._observed_at_m, self._way_m)
        self._last_bundle = np.append(self._last_bundle, self._bundles)
        self.numbers = np.append(self.numbers, self._next)
        self._next += 1
        return self._next - 1

    def _keep(self, keep: NDArray[np.bool_]) -> None:
        if keep.all():
            return
        both = np.repeat(keep, 2)
        self._white = self._white[both][:, both]
        self.points_xy, self._bias = self.points_xy[keep], self._bias[keep]
        self._called, self._votes, self.observations = self._called[keep], self._votes[keep], self.observations[keep]
        self._observed_at_m, self._last_bundle = self._observed_at_m[keep], self._last_bundle[keep]
        self.numbers = self.numbers[keep]
