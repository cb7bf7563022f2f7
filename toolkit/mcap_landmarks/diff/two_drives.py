"""Whether two recordings are of one drive or of two: whether they hold the same messages of the same moments."""

import hashlib
from collections import defaultdict
from collections.abc import Collection

from mcap_landmarks.channels import RESULTS
from mcap_landmarks.manifest import STAGE
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Connection

_WINDOW_NS = 10 * 10**9
"""So much of what both recordings cover in time is looked at: a hundred scans of a LiDAR at 10 Hz."""
_HEAD = 12
"""Bytes of a CDR message before what it says: encapsulation and time stamp."""


def are_two_drives(baseline: Recording, candidate: Recording) -> bool:
    """Whether two recordings are of different drives.

    They are where their times have nothing in common (an empty log has none), or where in the same seconds fewer than
    half of the messages of most topics are in both, byte for byte: logs of simulations all begin at one time. What
    results, what does not change in a log, such as a camera's calibration, and what only one side has tells nothing.
    """
    if baseline.fingerprint() == candidate.fingerprint():
        return False
    within = _shared_times(baseline, candidate)
    if within is None:
        return True
    topics = {one.topic for one in _sensed(baseline)} & {one.topic for one in _sensed(candidate)}
    mine, theirs = (_messages(side, topics, within) for side in (baseline, candidate))
    votes = [_is_shared(mine[topic], theirs[topic]) for topic in sorted(topics)]
    told = [vote for vote in votes if vote is not None]
    return bool(told) and sum(told) * 2 < len(told)


def _shared_times(baseline: Recording, candidate: Recording) -> tuple[int, int] | None:
    """The first seconds that both cover, from a log time on and before another; None where there are none."""
    start_ns = max(baseline.start_ns or 0, candidate.start_ns or 0)
    end_ns = min(baseline.end_ns or 0, candidate.end_ns or 0)
    return (start_ns, min(end_ns, start_ns + _WINDOW_NS) + 1) if start_ns <= end_ns else None


def _sensed(recording: Recording) -> list[Connection]:
    """The connections that are no results."""
    found = [entry.connection for entry in recording.channels if entry.count]
    return [one for one in found if STAGE not in one.metadata and not one.topic.startswith(RESULTS)]


def _messages(
    recording: Recording, topics: Collection[str], within: tuple[int, int]
) -> dict[str, set[tuple[int, bytes]]]:
    """Log time and digest, of all but the head, of the messages of each topic."""
    found: dict[str, set[tuple[int, bytes]]] = defaultdict(set)
    connections = [one for one in _sensed(recording) if one.topic in topics]
    for raw in recording.messages(connections, *within) if connections else ():
        digest = hashlib.blake2b(bytes(raw.data)[_HEAD:], digest_size=16).digest()
        found[raw.connection.topic].add((raw.log_time_ns, digest))
    return found


def _is_shared(mine: set[tuple[int, bytes]], theirs: set[tuple[int, bytes]]) -> bool | None:
    """Whether half of the messages or more are in both; None where they tell nothing."""
    fewer = min(len(mine), len(theirs))
    if not fewer or any(len({digest for _, digest in side}) == 1 for side in (mine, theirs)):
        return None
    return 2 * len(mine & theirs) >= fewer
