"""How the channels of an MCAP file are carried on: ROS 1 and Foxglove's types converted, all others as they are."""

from dataclasses import replace

from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.typestore import full_name
from mcap_landmarks.sources._db3 import unpacked
from mcap_landmarks.sources._foxglove import carry_foxglove
from mcap_landmarks.sources._foxglove_types import counterpart
from mcap_landmarks.sources._ros1_types import converted
from mcap_landmarks.sources._shape import Carried, Payload
from mcap_landmarks.stage import Connection


def carry(connection: Connection) -> Carried:
    """See `McapFile`; every channel of CDR gets an offered QoS, empty where the file says nothing of it."""
    topic, encoding = connection.topic, connection.schema_encoding
    found = counterpart(connection)
    if found is not None:
        return carry_foxglove(connection, found)
    if connection.message_encoding == "cdr":
        metadata = {KEY: "", **connection.metadata}
        kept = Connection(topic, full_name(connection.message_type), connection.schema, encoding, metadata=metadata)
        return Carried(kept, unpacked)
    if connection.message_encoding != "ros1" or encoding != "ros1msg":
        return Carried(replace(connection), lambda data: data)
    metadata = {KEY: qos_profile(latched=connection.metadata.get("latching") in {"1", "true"})}
    try:
        type_ = converted(connection.message_type, connection.schema.decode(errors="replace"))
    except MessageError as error:
        problem = f"topic {topic}: {error}; leave it out with --topics"

        def refuse(_data: Payload) -> Payload:
            raise RecordingError(problem)

        return Carried(Connection(topic, connection.message_type, b"", metadata=metadata), refuse)
    return Carried(Connection(topic, type_.message_type, type_.definition.encode(), metadata=metadata), type_.convert)
