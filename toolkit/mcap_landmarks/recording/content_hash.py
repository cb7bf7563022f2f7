"""Identity of a recording by its content: a hash over what stands for each of its blocks."""

import hashlib
from collections.abc import Sequence
from typing import BinaryIO

from mcap_landmarks.recording.container import CHUNK, RECORD, read_up_to
from mcap_landmarks.recording.reading_ahead import gather_heads, reading
from mcap_landmarks.recording.summary_index import Block


def hash_of(stream: BinaryIO, blocks: Sequence[Block]) -> str:
    """A hash over blocks: of a chunk its times, size and CRC stand for the content, which need not be read."""
    digest = hashlib.sha256()
    gather_heads(stream, blocks)
    with reading(stream, [block for block in blocks if not (block.is_chunk or block.head)]):
        for block in blocks:
            stream.seek(block.offset)
            if block.head:
                digest.update(block.head[: CHUNK.size])
            elif block.is_chunk:
                digest.update(stream.read(RECORD.size + CHUNK.size)[RECORD.size :])
            else:
                digest.update(read_up_to(stream, block.length))
    return digest.hexdigest()


def has_every_crc(stream: BinaryIO, blocks: Sequence[Block]) -> bool:
    """Whether each chunk among some blocks has a CRC that stands for its content."""
    gather_heads(stream, blocks)
    for block in blocks:
        if block.is_chunk:
            stream.seek(block.offset + RECORD.size + CHUNK.size - 4)
            if stream.read(4) == bytes(4):
                return False
    return True
