"""What the summary of a run counts in the messages that it writes, by message type."""

from collections.abc import Mapping
from functools import singledispatch

from toolkit.messages.codec import Message
from toolkit.messages.detections import Detections
from toolkit.messages.match import LandmarkMatch


@singledispatch
def tally(_message: Message) -> Mapping[str, int]:
    """Counts by name that one message adds to the summary, none for most."""
    return {}


@tally.register
def _(match: LandmarkMatch) -> Mapping[str, int]:
    """One bundle of its status."""
    return {match.status.name.lower(): 1}


@tally.register
def _(detections: Detections) -> Mapping[str, int]:
    """Detections by class."""
    counts: dict[str, int] = {}
    for hypotheses in detections.hypotheses:
        counts[hypotheses[0][0]] = counts.get(hypotheses[0][0], 0) + 1
    return counts
