"""The channels and schemas of a recording on its way: each under its own id, or under the one it had elsewhere."""

from dataclasses import dataclass, field

from mcap import records

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.recording.container import serialize
from mcap_landmarks.stage import Connection


@dataclass(slots=True)
class Declared:
    """Channels and schemas by id, and the channel of each connection."""

    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    ids: dict[Connection, int] = field(default_factory=dict)
    _last_channel: int = 0
    _last_schema: int = 0
    _by_content: dict[tuple[str, str, bytes], int] = field(default_factory=dict)

    def declare(self, connection: Connection) -> bytes:
        """Give a connection a channel, with an id above all others; the records to write.

        Raises:
            RecordingError: there are more channels than ids.
        """
        content = (connection.message_type, connection.schema_encoding, connection.schema)
        schema_id = 0
        if connection.message_type:
            schema_id = self._by_content.get(content, self._last_schema + 1)
        return self._declare(connection, self._last_channel + 1, schema_id)

    def keep(self, connection: Connection, channel_id: int, schema_id: int) -> bytes | None:
        """Give a connection the channel that it has in another recording; the records to write, None if it is taken."""
        schema = self.schemas.get(schema_id)
        wanted = (connection.message_type, connection.schema_encoding, connection.schema)
        if channel_id in self.channels or bool(schema_id) != bool(connection.message_type):
            return None
        if schema is not None and (schema.name, schema.encoding, schema.data) != wanted:
            return None
        return self._declare(connection, channel_id, schema_id)

    def _declare(self, connection: Connection, channel_id: int, schema_id: int) -> bytes:
        if channel_id > 0xFFFF:
            raise RecordingError(f"{connection.topic} is channel {channel_id}; MCAP holds 65535: choose topics")
        put = b""
        if schema_id and schema_id not in self.schemas:
            name, encoding, data = connection.message_type, connection.schema_encoding, connection.schema
            self.schemas[schema_id] = records.Schema(schema_id, data, encoding, name)
            self._by_content.setdefault((name, encoding, data), schema_id)
            self._last_schema = max(self._last_schema, schema_id)
            put = serialize(self.schemas[schema_id])
        metadata, encoding = dict(connection.metadata), connection.message_encoding
        self.channels[channel_id] = records.Channel(channel_id, connection.topic, encoding, metadata, schema_id)
        self._last_channel = max(self._last_channel, channel_id)
        self.ids[connection] = channel_id
        return put + serialize(self.channels[channel_id])
