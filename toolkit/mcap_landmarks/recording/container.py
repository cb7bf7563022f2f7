"""The bytes of MCAP that the hot paths read and write themselves; everything else is left to mcap.records."""

from io import SEEK_END, BytesIO
from struct import Struct
from struct import error as struct_error
from typing import BinaryIO, TypeVar

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import McapRecord

MAGIC = b"\x89MCAP0\r\n"
RECORD = Struct("<BQ")  # opcode, length
MESSAGE = Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
MESSAGE_FIXED = MESSAGE.size - RECORD.size
CHUNK = Struct("<QQQI")  # first and last log time, uncompressed size, uncompressed crc
FOOTER_SIZE = RECORD.size + 20
LARGEST_CHUNK = 1 << 30
"""A chunk that claims to be larger is taken for damage, and not allocated: recorders write chunks of a few MB."""

_AT_ONCE = 1 << 20
"""So many bytes are asked of a file without a look at how many it has left."""

R = TypeVar("R", bound=McapRecord)


def read_up_to(stream: BinaryIO, size: int) -> bytes:
    """So many bytes, fewer at the end of the file: Python would allocate all that a damaged length claims."""
    if size > _AT_ONCE:
        here = stream.tell()
        size = min(size, stream.seek(0, SEEK_END) - here)
        stream.seek(here)
    return stream.read(max(size, 0))


def parse(record: type[R], content: bytes | memoryview) -> R:
    """Record of a class of mcap.records from its content, the bytes after opcode and length.

    Raises:
        McapError, ValueError: the content is none such.
    """
    try:
        found: R = record.read(ReadDataStream(BytesIO(content)))  # type: ignore[attr-defined] # every record class has it
    except struct_error as error:  # a field of fixed length is cut
        raise EndOfFile from error
    return found


def serialize(*records: McapRecord) -> bytes:
    """Bytes of whole records, opcode and length included."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call] # mcap does not type it
    return bytes(data)


__all__ = [
    "CHUNK",
    "FOOTER_SIZE",
    "LARGEST_CHUNK",
    "MAGIC",
    "MESSAGE",
    "MESSAGE_FIXED",
    "RECORD",
    "Opcode",
    "parse",
    "read_up_to",
    "serialize",
]
