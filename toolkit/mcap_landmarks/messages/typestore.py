"""The message definitions we speak: humble's, and those in schemas/."""

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from mcap_landmarks.resources import resource

RosObject = Any
"""A message, or a part of one, of the typestore: its classes are made at run time, so that no checker knows them."""

_OWN_PACKAGES = ("vision_msgs", "foxglove_msgs", "mcap_landmarks_msgs")


@cache
def typestore() -> Typestore:
    """Humble's types and ours; building it takes some 50 ms, so it is built once."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for package in _OWN_PACKAGES:
        types = {}
        for path in sorted(resource("schemas", package).glob("*.msg")):
            types.update(get_types_from_msg(path.read_text(), f"{package}/msg/{path.stem}"))
        store.register(types)
    return store


@cache
def definition(ros_type: str) -> str:
    """The `ros2msg` schema text of a type such as `nav_msgs/msg/Odometry`, with all that it needs."""
    return typestore().generate_msgdef(ros_type, ros_version=2)[0]
