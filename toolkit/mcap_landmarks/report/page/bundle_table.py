"""The bundles of a log with results: when each was, and what came of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import DETECTIONS, MATCH, SCAN_OBJECTS, SCENE_OBJECTS
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.evaluation.trajectory import Indices
from mcap_landmarks.inspection.topic_roles import Choice, choose
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.typestore import definition_in
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Channel

STATUSES = (*(status.name.lower() for status in Status), "mapped", "unmatched")
"""What a bundle can be: what came of its match, on the path of a map that was made, or neither yet."""
WORDS = (
    "localized",
    "ambiguous",
    "too few objects",
    "no match",
    "inconsistent",
    "weak geometry",
    "on the path of the map",
    "not matched yet",
)
HINTS = (
    "all conditions of a match held",
    "several places of the map fit as well",
    "fewer objects than a pose needs",
    "no place of the map fits",
    "most of the objects or their distances do not fit the place",
    "the objects stand so that the pose would be too uncertain",
    "a pose of the path that was found with the map",
    "no stage has matched it with a map",
)
"""The statuses in words, and what they mean."""
MAPPED, UNMATCHED = len(Status), len(Status) + 1
_CHANNELS: tuple[Channel[Message], ...] = (MATCH, SCENE_OBJECTS, SCAN_OBJECTS, DETECTIONS)
"""Whose messages are the bundles: those of the stage that got farthest."""


@dataclass(frozen=True, slots=True, eq=False)
class BundleTable:
    """N bundles in the order of time: stamps and log times (N,) in ns, the places (N,) of their statuses in STATUSES.

    `stage` is the channel that they were read from, None where there is no bundle.
    """

    stamps_ns: Indices
    logged_ns: Indices
    statuses: NDArray[np.int64]
    stage: Channel[Message] | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which were matched and not localized."""
        found: NDArray[np.bool_] = (self.statuses > Status.LOCALIZED) & (self.statuses < MAPPED)
        return found


NO_BUNDLES = BundleTable(*np.zeros((3, 0), dtype=np.int64))


def read_bundles(recording: Recording, path_ns: Indices) -> BundleTable:
    """The bundles of a recording; those with a pose at a time of `path_ns` (K,) are on the path of a map."""
    for channel in _CHANNELS:
        found = _read(recording, channel)
        if found is not None:
            stamps_ns, logged_ns, statuses = found
            if channel is not MATCH:
                statuses = np.where(np.isin(stamps_ns, path_ns), MAPPED, UNMATCHED)
            _, first = np.unique(stamps_ns, return_index=True)
            return BundleTable(stamps_ns[first], logged_ns[first], statuses[first], channel)
    return NO_BUNDLES


def _read(recording: Recording, channel: Channel[Message]) -> tuple[Indices, Indices, Indices] | None:
    """Stamps, log times and statuses of a channel's messages; None if it has none that can be read."""
    try:
        connections = choose(recording, channel, Choice())
    except UsageError:
        return None
    parts = []
    for connection in connections:
        ros_type = channel.message.ROS_TYPE
        fields = ("header.stamp", "status") if channel is MATCH else ("header.stamp",)
        try:
            layout = layout_of(ros_type, definition_in(ros_type, connection.schema.decode(errors="replace")))
            found = recording.columns(connection, layout, fields)
        except MessageError:
            continue
        stamps = found.table.columns["header.stamp"].values[:, 0]
        numbers = found.table.columns["status"].values[:, 0] if channel is MATCH else np.zeros(len(stamps))
        times = np.where(stamps == 0, found.log_time_ns, stamps)
        known = (numbers >= 0) & (numbers < MAPPED)
        parts.append((times[known], found.log_time_ns[known], numbers[known].astype(np.int64)))
    if not sum(len(times) for times, _, _ in parts):
        return None
    times, logged, statuses = (np.concatenate(column) for column in zip(*parts, strict=True))
    return times, logged, statuses
