"""Foxglove's own types, in protobuf, JSON or CDR, carried on as their counterparts of ROS 2."""

from collections.abc import Callable
from struct import error as struct_error

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.messages.typestore import RosObject, definition, typestore
from mcap_landmarks.sources._foxglove_fields import FieldsOf, JsonFields, RosFields
from mcap_landmarks.sources._foxglove_types import COUNTERPARTS, Counterpart, is_origin, pose_of
from mcap_landmarks.sources._shape import Carried, Payload
from mcap_landmarks.stage import Connection

_FLAT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
Read = Callable[[Payload], FieldsOf]


def carry_foxglove(connection: Connection, found: Counterpart) -> Carried:
    """How a connection is carried on as its counterpart.

    Raises:
        MessageError: its schema cannot be understood.
    """
    latched = connection.topic.endswith(TF_STATIC.topic) and found.ros_type == TFMessage.ROS_TYPE
    quality = connection.metadata.get(KEY) or qos_profile(latched=latched)
    schema = definition(found.ros_type).encode()
    target = Connection(connection.topic, found.ros_type, schema, metadata={**connection.metadata, KEY: quality})
    read = _reader(connection)
    if found is COUNTERPARTS["LaserScan"]:
        frame = ScanFrame(connection.topic, read)
        return Carried(target, _conversion(connection, found, read, frame.put), frame.mount)
    return Carried(target, _conversion(connection, found, read))


def _conversion(
    connection: Connection, found: Counterpart, read: Read, change: Callable[[FieldsOf, RosObject], None] | None = None
) -> Callable[[Payload], Payload]:
    def convert(data: Payload) -> Payload:
        try:
            fields = read(data)
            fields.require(*found.needs)
            ros = found.build(fields)
            if change is not None:
                change(fields, ros)
            return typestore().serialize_cdr(ros, found.ros_type)
        except (SerdeError, struct_error, OverflowError, UnicodeError, MessageError) as error:
            raise MessageError(f"{len(data)} bytes are not a {connection.message_type}: {error}") from error

    return convert


def _reader(connection: Connection) -> Read:
    if connection.message_encoding == "json":
        return JsonFields.read
    if connection.message_encoding == "protobuf":
        from mcap_landmarks.sources._foxglove_protobuf import protobuf_reader  # noqa: PLC0415 - seldom needed, and slow

        return protobuf_reader(connection.message_type, connection.schema)
    return _ros_reader(connection.message_type, connection.schema)


def _ros_reader(ros_type: str, schema: bytes) -> Read:
    """Reads messages in CDR by the definition that came with them.

    Raises:
        MessageError: it cannot be understood.
    """
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(schema.decode(), ros_type))
    except (TypesysError, UnicodeError, KeyError, RecursionError) as error:
        raise MessageError(f"the definition of {ros_type} cannot be understood: {error}") from error

    def read(data: Payload) -> FieldsOf:
        try:
            return RosFields(store.deserialize_cdr(data, ros_type))
        except (SerdeError, struct_error, IndexError, ValueError, KeyError) as error:
            raise MessageError(str(error) or type(error).__name__) from error

    return read


class ScanFrame:
    """Where the scans of a topic are, which Foxglove's tell themselves: in a frame of their own, with a transform.

    ROS's LaserScan lies in its frame as it is. Where the first scan is placed otherwise, all get the frame
    `FRAME/TOPIC`, of which `mount` tells where it is; a scan that is placed elsewhere than the first one is refused.
    """

    def __init__(self, topic: str, read: Read) -> None:
        self._name, self._read = topic.strip("/"), read
        self._first: tuple[float, ...] = _FLAT

    def mount(self, first: Payload) -> bytes | None:
        """The TFMessage that says where the scans are, of the first of them; None where that is their frame."""
        fields = self._read(first)
        pose, frame_id = pose_of(fields.part("pose")), fields.text("frame_id")
        if is_origin(pose):
            return None
        self._first = (*pose[0], *pose[1])
        transform = Transform(fields.time_ns("timestamp"), frame_id, f"{frame_id}/{self._name}", *pose)
        return encode(TFMessage((transform,)))

    def put(self, fields: FieldsOf, ros: RosObject) -> None:
        """Name the frame of a scan."""
        pose = pose_of(fields.part("pose"))
        if self._first is _FLAT and is_origin(pose):
            return
        if (*pose[0], *pose[1]) != self._first:
            raise MessageError("its pose is another than that of the first scan, and LaserScan has none")
        ros.header.frame_id = f"{ros.header.frame_id}/{self._name}"
