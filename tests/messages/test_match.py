"""LandmarkMatch as logs of earlier versions have it: their own definition says where it ends."""

import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.typestore import definition, definition_in, typestore, typestore_in

TYPE = LandmarkMatch.ROS_TYPE
NOW = definition(TYPE)
BEFORE = NOW.replace(
    "string[] condition_names\nfloat64[] condition_values\nfloat64[] condition_limits\nbool[] condition_held\n", ""
)
MATCH = LandmarkMatch(5, "base", Status.AMBIGUOUS, ("a",), conditions=(Condition("objects", 1.0, 2.0, held=False),))


def encoded_before() -> bytes:
    store = typestore_in(TYPE, BEFORE)
    ros = MATCH.to_ros()
    names = [name for name, _ in store.fielddefs[TYPE][1]]
    return bytes(store.serialize_cdr(store.types[TYPE](**{name: getattr(ros, name) for name in names}), TYPE))


def test_a_match_that_was_written_before_there_were_conditions() -> None:
    assert len(BEFORE) < len(NOW)
    found = decode(LandmarkMatch, encoded_before(), BEFORE)
    assert (found.status, found.object_ids, found.conditions) == (Status.AMBIGUOUS, ("a",), ())
    with pytest.raises(MessageError):
        decode(LandmarkMatch, encoded_before())


def test_a_match_of_today_is_read_by_its_definition_too() -> None:
    assert decode(LandmarkMatch, encode(MATCH), NOW).conditions == MATCH.conditions


@pytest.mark.parametrize(
    ("ros_type", "schema"),
    [
        (TYPE, NOW),
        (TYPE, "no definition"),
        (TYPE, BEFORE.replace("uint8 status", "uint16 status")),
        (TYPE, BEFORE.replace("uint32 bundles_joined", "uint32 bundles_joined\nstring other")),
        (PoseStamped.ROS_TYPE, "std_msgs/Header header"),
    ],
)
def test_only_earlier_versions_of_our_own_messages_are_read_by_the_logs_definition(ros_type: str, schema: str) -> None:
    assert definition_in(ros_type, schema) == definition(ros_type)
    assert typestore_in(ros_type, schema) is typestore()
