"""The surveyed map that a recording's truth gives, as a landmark database."""

from mcap_landmarks.channels import TRUTH_OBJECTS
from mcap_landmarks.errors import MapError
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import Manifest
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.map_message import map_from_scene
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.replacing import check_apart, earlier_map, output_to

_VERB = "map --from-reference"
"""What the manifest calls what made it: a surveyed map is no other version of one that was built."""


def map_from_reference(log: Location, target: Location, *, overwrite: bool = False) -> LandmarkMap:
    """The map of a log's `/ground_truth/objects`, written as a database.

    Raises:
        MapError: the log has no such message.
        UsageError: the database is the log, or holds another map and is not to be overwritten.
    """
    check_apart([target], [log])
    with open_recording(log) as recording:
        raw = next(recording.messages(recording.connections(TRUTH_OBJECTS.topic)), None)
        if raw is None:
            raise MapError(
                f"{log}: there are no {TRUTH_OBJECTS.topic}; build the map from the log without --from-reference"
            )
        scene = decode(TRUTH_OBJECTS.message, raw.data)
        fingerprint = recording.fingerprint()
        landmark_map = map_from_scene(scene, MapSource("reference", fingerprint))
    with output_to(target, [log], earlier_map(_VERB, [fingerprint]), overwrite=overwrite):
        write_map(target, landmark_map, Manifest(_VERB, inputs=(fingerprint,)).entries())
    return landmark_map
