"""How far a log's ranges scatter about the outlines of objects, where that is more than was assumed."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

from mcap_landmarks.lidar.beams import Beams
from mcap_landmarks.lidar.clustering import Shapes, noise_of, pieces
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.objects import evidence
from mcap_landmarks.lidar.segments import hits_of

_T = TypeVar("_T")

_STEP, _STEPS = 2**0.5, 6
"""Noise is looked for in steps: each is half an octave, less than a scan or two could tell apart, up to eight times."""
_SURELY = 3.0
"""The next step is taken where it is likelier by this logarithm: by chance in one log of twenty at most (Ville)."""
_TELLING_HITS = 4
"""Fewer hits lie on the outline of something wherever they are: place, turn and size have to follow from them."""
_AT_FIRST, _LATER = 64, 16
"""So many scans are all looked at, before the first of them counts; of those after them every so manieth is."""


def with_noise(
    scans: Iterable[tuple[_T, Beams | None]], shapes: Shapes, config: ClusterConfig, is_large: Callable[[_T], bool]
) -> Iterator[tuple[_T, Beams | None, ClusterConfig]]:
    """Scans with the configuration that has their noise: at first that of many scans, unless they are too large to wait
    or have no beams; `shapes` are those of the configuration."""
    noise, waiting = RangeNoise(shapes, config), list[tuple[_T, Beams | None]]()
    for scan, beams in scans:
        waiting.append((scan, beams))
        if beams is not None:
            noise.learn(beams)
        if beams is None or noise.is_settled or is_large(scan):
            yield from ((*one, noise.config) for one in waiting)
            waiting.clear()
    yield from ((*one, noise.config) for one in waiting)


class RangeNoise:
    """Learns the noise of ranges from the scans of a log, one after the other.

    The evidence for objects of known shapes, whose place, turn and size are integrated out, says how likely each noise
    makes the hits: type II maximum likelihood over a few values, as in model selection (MacKay, Bayesian interpolation,
    1992). What has no known shape says nothing. Noise below the assumed one is never believed, and what scans say for
    the next step adds up, so that it is left again where more of them speak against it.
    """

    def __init__(self, shapes: Shapes, config: ClusterConfig) -> None:
        self._shapes, self._config = shapes, config
        self._gains = [0.0] * _STEPS
        self._step = self._scans = 0

    @property
    def is_settled(self) -> bool:
        """Whether enough scans were looked at."""
        return self._scans >= _AT_FIRST

    @property
    def config(self) -> ClusterConfig:
        """The configuration with the noise that the scans so far have."""
        return self._with(self._step)

    def learn(self, beams: Beams) -> None:
        """Look at the next scan, unless those before it said enough."""
        self._scans += 1
        if self._scans > _AT_FIRST and self._scans % _LATER:
            return
        clusters = [
            one for one in pieces(beams, self._shapes, self._config) if len(hits_of(beams, one)) >= _TELLING_HITS
        ]
        if not clusters:
            return
        known: dict[int, float] = {}

        def gain(step: int) -> float:
            """How much likelier this scan is with the step after this one."""
            for i in (step, step + 1):
                if i not in known:
                    known[i] = evidence(beams, clusters, self._shapes, noise_of(self._with(i)))
            return known[step + 1] - known[step]

        if self._step:
            self._gains[self._step - 1] += gain(self._step - 1)
            if self._gains[self._step - 1] < 0:
                self._step -= 1
                return
        while self._step < _STEPS:
            self._gains[self._step] += gain(self._step)
            if self._gains[self._step] <= _SURELY:
                return
            self._step += 1

    def _with(self, step: int) -> ClusterConfig:
        return replace(self._config, sigma_m=self._config.sigma_m * _STEP**step) if step else self._config
