"""Which fields the records of MCAP have, and whether bytes can be such a record: without parsing, and strictly."""

from collections.abc import Callable
from struct import Struct

from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import RECORD, Opcode

_P4, _P8 = -4, -8
"""Fields that begin with their length, of so many bytes."""
SHAPES: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (_P4, _P4),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, _P4, _P4, _P4),
    Opcode.CHANNEL: (4, _P4, _P4, _P4),
    Opcode.MESSAGE: (22,),
    Opcode.CHUNK: (28, _P4, _P8),
    Opcode.MESSAGE_INDEX: (2, _P4),
    Opcode.CHUNK_INDEX: (32, _P4, 8, _P4, 16),
    Opcode.ATTACHMENT: (16, _P4, _P4, _P8, 4),
    Opcode.ATTACHMENT_INDEX: (40, _P4, _P4),
    Opcode.STATISTICS: (42, _P4),
    Opcode.METADATA: (_P4, _P4),
    Opcode.METADATA_INDEX: (16, _P4),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
"""Fields by opcode: bytes that are fixed, or a length that stands before the field (MCAP specification, Records)."""
_SLACK = 64
"""Readers take records that later versions of the format made longer; by more than this none has ever grown."""
LARGEST_RECORD = 64 << 20
"""Records of definitions and metadata that claim more are taken for damage: a large schema has some 100 KB."""
_LENGTHS = {_P4: Struct("<I"), _P8: Struct("<Q")}
_LONG = {Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT}

ReadAt = Callable[[int, int], bytes]
"""So many bytes from a place on, fewer at the end."""


def fields_end(opcode: int, length: int, read: ReadAt, offset: int = 0) -> int | None:
    """How long the fields of a record's content at an offset are; None if these bytes cannot be such a content."""
    if opcode not in SHAPES or (opcode not in _LONG and length > LARGEST_RECORD):
        return None
    position = 0
    for field in SHAPES[opcode]:
        if field > 0:
            position += field
        else:
            head = read(offset + position, -field)
            if len(head) < -field:
                return None
            position += -field + _LENGTHS[field].unpack(head)[0]
        if position > length:
            return None
    return position if opcode == Opcode.MESSAGE or length - position <= _SLACK else None


def fits(opcode: int, length: int, read: ReadAt, offset: int = 0) -> bool:
    """Whether content at an offset can be that of a record: its fields fill it, but for a little at its end."""
    return fields_end(opcode, length, read, offset) is not None


def check_content(opcode: int, content: bytes | memoryview) -> None:
    """Refuse a content in memory that cannot be that of a record.

    Raises:
        ValueError: as it says.
    """
    if fields_end(opcode, len(content), lambda offset, size: bytes(content[offset : offset + size])) is None:
        raise ValueError(f"no record {opcode}")


def check_attachment(content: bytes) -> None:
    """Refuse the content of an attachment whose fields or CRC, where it has one, do not fit.

    Raises:
        ValueError: as it says.
    """
    end = fields_end(Opcode.ATTACHMENT, len(content), lambda offset, size: content[offset : offset + size])
    if end is None:
        raise ValueError("no attachment")
    crc = int.from_bytes(content[end - 4 : end], "little")
    if crc and crc32(memoryview(content)[: end - 4]) != crc:
        raise ValueError("its CRC does not match")


def head_at(read: ReadAt, offset: int) -> tuple[int, int]:
    """Opcode and length that stand at an offset; opcode 0, which no record has, where the file ends."""
    head = read(offset, RECORD.size)
    if len(head) < RECORD.size:
        return 0, 0
    opcode, length = RECORD.unpack(head)
    return int(opcode), int(length)
