"""What the user adds to the stamps of a role's messages, whose clock is another one."""

from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation

from mcap_landmarks import channels
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.stage import Channel

OFFSET_ROLES: Mapping[Channel[Message], str] = {
    channels.ODOMETRY: "odometry",
    channels.SCAN: "scan",
    channels.SECOND_SCAN: "second_scan",
    channels.SCAN_OBJECTS: "scan",
    channels.CLUSTERED_CLOUD: "scan",
    channels.DETECTIONS: "image",
    channels.SCENE_OBJECTS: "scene_objects",
    channels.SCENE_VELOCITIES: "scene_objects",
}
"""The role whose clock stamped a channel's messages. Images keep their stamps, since annotations must match them: what
was detected in them is corrected when it is read."""
_LARGEST_NS = 2**63
"""Times do not reach further from the epoch."""


def parse_offsets(texts: Sequence[str]) -> dict[str, int]:
    """Role to nanoseconds of texts `ROLE=SECONDS`.

    Raises:
        UsageError: a role is unknown or named twice, or the seconds are no number.
    """
    roles, offsets = list(dict.fromkeys(OFFSET_ROLES.values())), dict[str, int]()
    for text in texts:
        role, _, seconds = text.partition("=")
        if role not in roles:
            raise UsageError(f"--time-offset {text}: write ROLE=SECONDS with a role of {', '.join(roles)}")
        if role in offsets:
            raise UsageError(f"--time-offset {text}: {role} has an offset already; give one")
        try:
            offset_ns = Decimal(seconds) * 10**9
            offsets[role] = round(offset_ns)
        except (InvalidOperation, ValueError, OverflowError):
            offset_ns = Decimal("Infinity")
        if not abs(offset_ns) < _LARGEST_NS:
            raise UsageError(f"--time-offset {text}: give seconds, such as {role}=-0.5")
    return offsets
