"""What the summary of a run counts in the messages that it writes, by message type."""

from collections import Counter
from collections.abc import Mapping
from functools import singledispatch

from mcap_landmarks.channels import MAP_FRAME
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects


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
    return Counter(hypotheses[0][0] for hypotheses in detections.hypotheses)


@tally.register
def _(scene: SceneObjects) -> Mapping[str, int]:
    """Objects of a scene by class; a map is no scene."""
    return {} if scene.frame_id == MAP_FRAME else Counter(scene.classes)


@tally.register
def _(found: ScanObjects) -> Mapping[str, int]:
    """Objects in scans by whether a known shape explains them."""
    known = sum(options[0][1] > options[-1][1] for options in found.hypotheses)
    return {"known": known, "unknown": len(found) - known}
