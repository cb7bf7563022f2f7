"""The topics of an SQLite file of a ROS 2 bag, with the definitions of their types or those that these may have."""

import sqlite3
from dataclasses import dataclass, replace

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.qos import KEY
from mcap_landmarks.sources._bag_metadata import described
from mcap_landmarks.sources._definition_text import parts_of
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources._ros2_types import known_distribution
from mcap_landmarks.sources._shape import BagDescription, Definition
from mcap_landmarks.sources._verification import defined
from mcap_landmarks.stage import Connection

_LANGUAGES = {"ros2msg", "ros2idl"}


@dataclass(frozen=True, slots=True)
class Db3Topic:
    """A row of the table of topics. definitions: those that it may have, not verified yet; none if the bag has it."""

    connection: Connection
    definitions: tuple[Definition, ...] = ()


def rows_of(database: sqlite3.Connection, query: str) -> list[sqlite3.Row]:
    """All rows that a query gives."""
    return database.execute(query).fetchall()


def texts_of(row: sqlite3.Row) -> dict[str, str]:
    """The columns of a row that are texts: SQLite lets any column hold anything."""
    return {key: value for key, value in dict(row).items() if isinstance(value, str)}


def columns_of(database: sqlite3.Connection, table: str, column: str) -> set[str]:
    """The values of a column."""
    return {str(row[column]) for row in rows_of(database, f"SELECT {column} FROM {table}")}  # noqa: S608 - our own names


def definitions_in(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Encoding and text by type, of those that the file defines."""
    if "message_definitions" not in columns_of(database, "sqlite_master", "name"):
        return {}
    found = rows_of(database, "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
    return {row[0]: (row[1], row[2]) for row in found if row[1] in _LANGUAGES and len(texts_of(row)) == 3}


def distribution_in(database: sqlite3.Connection) -> str | None:
    """What the file itself calls the distribution it was recorded with, if that is one."""
    if "schema" not in columns_of(database, "sqlite_master", "name"):
        return None
    names = [str(dict(row).get("ros_distro", "")) for row in rows_of(database, "SELECT * FROM schema")]
    return next((name for name in names if known_distribution(name)), None)


def about_in(database: sqlite3.Connection, distribution: str | None) -> BagDescription:
    """What the file says of the bag."""
    texts: list[str] = []
    if "metadata" in columns_of(database, "sqlite_master", "name"):
        texts = [str(dict(row).get("metadata", "")) for row in rows_of(database, "SELECT * FROM metadata")]
    found = described(texts[-1]) if texts else None
    return replace(found or BagDescription(), distribution=distribution or (found.distribution if found else None))


def topic_of(row: dict[str, str], own: dict[str, tuple[str, str]], definitions: Definitions) -> Db3Topic:
    """A topic with the definition that the file has of its type, or those that it may have.

    Raises:
        MessageError: its messages are not CDR, or nothing defines them.
    """
    name, message_type = row["name"], row["type"]
    metadata = {KEY: row.get("offered_qos_profiles") or ""}
    if digest := row.get("type_description_hash"):
        metadata["topic_type_hash"] = digest
    if (encoding := row.get("serialization_format")) != "cdr":
        raise MessageError(f"its messages are {encoding}, not CDR")
    connection = Connection(name, message_type, b"", metadata=metadata)
    if message_type.endswith("_Event") and (text := _service_text(message_type, own)):
        event = definitions.service_event(message_type, text)
        return Db3Topic(defined(connection, event), (event,))
    if message_type in own:
        encoding, text = own[message_type]
        return Db3Topic(replace(connection, schema=text.encode(), schema_encoding=encoding))
    found = definitions.of(message_type)
    return Db3Topic(defined(connection, found[0]), found)


def _service_text(event: str, own: dict[str, tuple[str, str]]) -> str | None:
    """The definition of an event's service: rosbag2 keeps it under the name of the service, or of the event."""
    texts = [own[name][1] for name in (event, event.removesuffix("_Event")) if name in own]
    return next((text for text in texts if len(parts_of(text)) > 1), None)
