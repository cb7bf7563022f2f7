"""Messages of protobuf, read by the descriptors in their schema: no code is generated."""

from collections.abc import Callable
from graphlib import CycleError, TopologicalSorter
from typing import Self

from google.protobuf import any_pb2, duration_pb2, empty_pb2, struct_pb2, timestamp_pb2, wrappers_pb2
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from mcap_landmarks.errors import MessageError
from mcap_landmarks.sources._foxglove_fields import FieldsOf

_WELL_KNOWN = (any_pb2, duration_pb2, empty_pb2, struct_pb2, timestamp_pb2, wrappers_pb2)
"""Files that writers may leave out of a schema, since every protobuf library has them."""


class ProtobufFields(FieldsOf):
    """Of a protobuf message; a field without presence is there with its default."""

    def __init__(self, content: Message) -> None:
        self._content = content

    def get(self, name: str) -> object:
        """See `FieldsOf`."""
        field = self._content.DESCRIPTOR.fields_by_name.get(name)
        if field is None or (field.message_type and field.has_presence and not self._content.HasField(name)):
            return None
        value: object = getattr(self._content, name)
        return value

    def _inner(self, value: object) -> Self | None:
        return type(self)(value) if isinstance(value, Message) else None


def protobuf_reader(message_type: str, schema: bytes) -> Callable[[bytes | memoryview], ProtobufFields]:
    """What reads messages of a type, of its full name and the FileDescriptorSet that defines it.

    Raises:
        MessageError: it is not defined there, or what is needed for it is missing or stands against itself.
    """
    try:
        message_class = GetMessageClass(_pool(schema).FindMessageTypeByName(message_type))
    except (DecodeError, CycleError, TypeError, KeyError, ValueError) as error:
        what = error.args[0] if error.args else type(error).__name__
        raise MessageError(f"the schema of {message_type} cannot be understood: {what}") from error

    def read(data: bytes | memoryview) -> ProtobufFields:
        try:
            return ProtobufFields(message_class.FromString(bytes(data)))
        except DecodeError as error:
            raise MessageError(f"{len(data)} bytes are not a {message_type}: {error}") from error

    return read


def _pool(schema: bytes) -> DescriptorPool:
    """The files of a FileDescriptorSet, each after those that it needs; the first of a name counts, as writers do."""
    files: dict[str, FileDescriptorProto] = {}
    for file in FileDescriptorSet.FromString(schema).file:
        files.setdefault(file.name, file)
    known = {module.DESCRIPTOR.name: module.DESCRIPTOR.serialized_pb for module in _WELL_KNOWN}
    needs = TopologicalSorter({name: file.dependency for name, file in files.items()})
    pool = DescriptorPool()
    for name in needs.static_order():
        text = files[name].SerializeToString() if name in files else known.get(name)
        if text is None:
            raise MessageError(f"its schema lacks the file {name}")
        pool.AddSerializedFile(text)
    return pool
