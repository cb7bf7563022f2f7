"""The message definitions we speak: humble's, and those in schemas/."""

from functools import cache, lru_cache
from typing import Any

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from mcap_landmarks.resources import resource

RosObject = Any
"""A message, or a part of one, of the typestore: its classes are made at run time, so that no checker knows them."""

OWN_PACKAGES = ("vision_msgs", "foxglove_msgs", "mcap_landmarks_msgs", "theora_image_transport")
"""Those whose definitions lie in schemas/."""
_GROWING = ("mcap_landmarks_msgs",)  # the others are defined elsewhere, and stay as they are


@cache
def typestore() -> Typestore:
    """Humble's types and ours; building it takes some 50 ms, so it is built once."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for package in OWN_PACKAGES:
        types = {}
        for path in sorted(resource("schemas", package).glob("*.msg")):
            types.update(get_types_from_msg(path.read_text(), f"{package}/msg/{path.stem}"))
        store.register(types)
    return store


def full_name(ros_type: str) -> str:
    """The name of a type as ROS 2 has it, `nav_msgs/msg/Odometry`, of that or of ROS 1's without `msg`."""
    return ros_type.replace("/", "/msg/") if ros_type.count("/") == 1 else ros_type


@cache
def definition(ros_type: str) -> str:
    """The `ros2msg` schema text of a type such as `nav_msgs/msg/Odometry`, with all that it needs."""
    return typestore().generate_msgdef(ros_type, ros_version=2)[0]


@lru_cache(maxsize=64)
def definition_in(ros_type: str, schema: str) -> str:
    """The definition by which to read a log that defines a type in `schema`: ours, or that of our earlier version.

    Our own messages grow at their end: a log of an earlier version defines only the fields that there were then. All
    other types are read by what they are known to be.
    """
    ours = definition(ros_type)
    if ros_type.partition("/")[0] not in _GROWING:
        return ours
    try:
        then = get_types_from_msg(schema, ros_type)[ros_type][1]
    except TypesysError:
        return ours
    now = typestore().fielddefs[ros_type][1]
    return schema if len(then) < len(now) and then == now[: len(then)] else ours


@lru_cache(maxsize=64)
def typestore_in(ros_type: str, schema: str) -> Typestore:
    """The typestore that reads messages of a log that defines their type in `schema`; see `definition_in`."""
    if definition_in(ros_type, schema) == definition(ros_type):
        return typestore()
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema, ros_type))
    return store
