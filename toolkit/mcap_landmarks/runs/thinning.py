"""Leave out images that come faster, or from nearer to each other, than anyone needs."""

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcap_landmarks.channels import ODOMETRY
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.geometry.se2 import Array, between
from mcap_landmarks.inspection.topic_roles import message_type
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.stage import Connection, RawMessage

_DISTANCE = re.compile(r"(?P<number>.*)(?P<unit>deg|m)")
TOO_FAST, TOO_NEAR = "images left out by --image-rate", "images left out by --every"


@dataclass(frozen=True, slots=True)
class Thinning:
    """Which images are wanted: at most `rate_hz`, and only after the robot moved `every_m` or turned `every_rad`."""

    rate_hz: float | None = None
    every_m: float | None = None
    every_rad: float | None = None

    @property
    def by_motion(self) -> bool:
        """Whether odometry has a say."""
        return self.every_m is not None or self.every_rad is not None

    def options(self) -> dict[str, object]:
        """For the manifest: what was asked for."""
        given = {"image_rate_hz": self.rate_hz, "every_m": self.every_m, "every_rad": self.every_rad}
        return {name: value for name, value in given.items() if value is not None}


def parse_thinning(rate_hz: float | None, every: str | None) -> Thinning:
    """The thinning of the texts of two options, such as `0.2m,5deg`.

    Raises:
        UsageError: a number is not above zero, or a unit is neither m nor deg.
    """
    if rate_hz is not None and not (rate_hz > 0 and math.isfinite(rate_hz)):
        raise UsageError(f"--image-rate {rate_hz:g}: give images per second, above 0")
    given: dict[str, float] = {}
    for part in every.split(",") if every else ():
        found = _DISTANCE.fullmatch(part.strip())
        value = _above_zero(found["number"]) if found else None
        if found is None or value is None:
            raise UsageError(f"--every {every}: write metres, degrees or both, above 0, such as 0.2m,5deg")
        given[found["unit"]] = value
    degrees = given.get("deg")
    return Thinning(rate_hz, given.get("m"), None if degrees is None else math.radians(degrees))


def _above_zero(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value > 0 and math.isfinite(value) else None


def thin(
    raws: Iterable[RawMessage],
    images: Collection[Connection],
    odometry: Collection[Connection],
    thinning: Thinning,
    dropped: Counter[str],
    began: Mapping[str, Any] | None = None,
) -> Iterator[RawMessage]:
    """The messages without the images that nobody wants, which are counted in `dropped`; nothing else is left out.

    The rate is kept on the mean, by log time, and jitter costs no images. Motion is that of the latest odometry before
    an image; as long as there is none, every image is taken. Each of several topics of images is thinned by itself.
    What `thinned_before` tells of the messages before is where it `began`.
    """
    thinner = _Thinner(images, odometry, thinning, began)
    for raw in raws:
        reason = thinner.take(raw)
        if reason is None:
            yield raw
        else:
            dropped[reason] += 1


def thinned_before(
    raws: Iterable[RawMessage],
    images: Collection[Connection],
    odometry: Collection[Connection],
    thinning: Thinning,
    times_ns: Sequence[int],
) -> list[dict[str, Any]]:
    """How far thinning has come, in JSON values, before the messages from each of some rising log times on."""
    thinner, found = _Thinner(images, odometry, thinning, None), list[dict[str, Any]]()
    for raw in raws:
        while len(found) < len(times_ns) and raw.log_time_ns >= times_ns[len(found)]:
            found.append(thinner.state())
        thinner.take(raw)
    return found + [thinner.state() for _ in times_ns[len(found) :]]


class _Thinner:
    """What was taken so far, and whether to take the next."""

    def __init__(
        self,
        images: Collection[Connection],
        odometry: Collection[Connection],
        thinning: Thinning,
        began: Mapping[str, Any] | None,
    ) -> None:
        self._images, self._odometry = images, odometry
        rates, motion = (began["rates"], began["motion"]) if began else ({}, None)
        topics = {entry.topic for entry in images} if thinning.rate_hz else ()
        self._rates = {topic: _Rate(thinning.rate_hz or 1.0, *rates.get(topic, ())) for topic in topics}
        self._motion = _Motion(thinning, motion) if thinning.by_motion else None

    def take(self, raw: RawMessage) -> str | None:
        """Take a message, or say why not."""
        if self._motion and raw.connection in self._odometry:
            self._motion.follow(raw)
        if raw.connection not in self._images:
            return None
        return _take(raw, self._rates.get(raw.connection.topic), self._motion)

    def state(self) -> dict[str, Any]:
        """Where to begin from here on."""
        rates = {topic: rate.state() for topic, rate in self._rates.items()}
        return {"rates": rates, "motion": self._motion.state() if self._motion else None}


def _take(raw: RawMessage, rate: "_Rate | None", motion: "_Motion | None") -> str | None:
    """Take an image, or say why not."""
    if rate and not rate.is_due(raw.log_time_ns):
        return TOO_FAST
    if motion and not motion.has_come_far(raw.connection.topic):
        return TOO_NEAR
    if rate:
        rate.take(raw.log_time_ns)
    if motion:
        motion.take(raw.connection.topic)
    return None


class _Rate:
    """A grid of moments from the first image on; each takes the first image that is nearest to it of them all."""

    def __init__(self, rate_hz: float, start_ns: int | None = None, taken: int = -1) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self._start_ns = start_ns
        self._taken = taken

    def state(self) -> tuple[int | None, int]:
        return self._start_ns, self._taken

    def is_due(self, time_ns: int) -> bool:
        return self._nearest(time_ns) > self._taken

    def take(self, time_ns: int) -> None:
        self._taken = self._nearest(time_ns)

    def _nearest(self, time_ns: int) -> int:
        if self._start_ns is None:
            self._start_ns = time_ns
        return (2 * (time_ns - self._start_ns) + self._period_ns - 1) // (2 * self._period_ns)


class _Motion:
    """How far the robot has come since the last image of a topic that was taken."""

    def __init__(self, thinning: Thinning, began: Mapping[str, Any] | None = None) -> None:
        self._thinning = thinning
        now, taken = (began["now"], began["taken"]) if began else (None, {})
        self._now = _pose(now)
        self._taken = {topic: _pose(pose) for topic, pose in taken.items()}

    def state(self) -> dict[str, Any]:
        taken = {topic: None if pose is None else pose.tolist() for topic, pose in self._taken.items()}
        return {"now": None if self._now is None else self._now.tolist(), "taken": taken}

    def follow(self, raw: RawMessage) -> None:
        try:
            found = odometry_from(decode(message_type(ODOMETRY, raw.connection), raw.data))
        except MessageError:
            return  # the stage that reads odometry counts it
        if found is not None and np.isfinite(found.pose).all():
            self._now = found.pose

    def has_come_far(self, topic: str) -> bool:
        taken = self._taken.get(topic)
        if self._now is None or taken is None:
            return True
        forward, left, turn = between(taken, self._now).tolist()
        far = self._thinning.every_m is not None and math.hypot(forward, left) >= self._thinning.every_m
        return far or (self._thinning.every_rad is not None and abs(turn) >= self._thinning.every_rad)

    def take(self, topic: str) -> None:
        self._taken[topic] = self._now


def _pose(values: Sequence[float] | None) -> Array | None:
    return None if values is None else np.array(values, dtype=np.float64)
