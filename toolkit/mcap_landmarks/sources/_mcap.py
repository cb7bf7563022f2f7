"""How the channels of an MCAP file are carried on: ROS 1 and Foxglove's types converted, all others as they are."""

from collections.abc import Mapping
from dataclasses import replace

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.typestore import full_name
from mcap_landmarks.sources._bag_metadata import recorded_metadata
from mcap_landmarks.sources._db3 import unpacker
from mcap_landmarks.sources._definition_text import decoded
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources._foxglove import carry_foxglove
from mcap_landmarks.sources._foxglove_types import counterpart
from mcap_landmarks.sources._ros1_types import converted
from mcap_landmarks.sources._shape import Carried
from mcap_landmarks.sources._verification import defined
from mcap_landmarks.stage import Connection


def carry(definitions: Definitions, connection: Connection, records: Mapping[str, Mapping[str, str]]) -> Carried:
    """See `McapFile`; every channel of CDR gets a definition, and an offered QoS, empty where the file says nothing."""
    topic, encoding = connection.topic, connection.schema_encoding
    found = counterpart(connection)
    if found is not None:
        return carry_foxglove(connection, found)
    if connection.message_encoding == "cdr":
        metadata = {KEY: "", **connection.metadata}
        kept = Connection(topic, full_name(connection.message_type), connection.schema, encoding, metadata=metadata)
        return Carried(kept, unpacker()) if connection.schema.strip() else _undefined(kept, definitions, records)
    if connection.message_encoding != "ros1" or encoding != "ros1msg":
        return Carried(replace(connection), lambda data: data)
    metadata = {KEY: qos_profile(latched=connection.metadata.get("latching") in {"1", "true"})}
    type_ = converted(
        connection.message_type, decoded(connection.schema), connection.metadata.get("md5sum", ""), definitions.files
    )
    return Carried(Connection(topic, type_.message_type, type_.definition.encode(), metadata=metadata), type_.convert)


def _undefined(connection: Connection, definitions: Definitions, records: Mapping[str, Mapping[str, str]]) -> Carried:
    """A channel whose schema is missing or empty."""
    about = recorded_metadata(records)
    message_type = connection.message_type or about.types.get(connection.topic, "")
    if not message_type:
        raise MessageError("the file does not say of which type its messages are")
    found = definitions.also(about.distribution).of(message_type)
    return Carried(defined(replace(connection, message_type=message_type), found[0]), unpacker(), definitions=found)
