"""What a ROS 1 bag holds and where: from the index at its end, or by scanning a bag that has none."""

from collections import Counter
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap_landmarks.sources import _bag_container as container
from mcap_landmarks.sources._bag_container import BagConnection, BagMessage, ChunkInfo, DamagedBagError


@dataclass(slots=True)
class BagIndex:
    """Connections by id, chunks by time, and in words what is known to be lost."""

    connections: dict[int, BagConnection] = field(default_factory=dict)
    chunks: list[ChunkInfo] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)

    def counts(self) -> Counter[int]:
        """Declared messages by connection id."""
        total: Counter[int] = Counter()
        for chunk in self.chunks:
            total.update(chunk.counts)
        return total


def read_index(stream: BinaryIO, size: int) -> BagIndex:
    """Index of a bag whose magic has been read.

    Raises:
        DamagedBagError: it does not begin with a bag header, or is encrypted.
    """
    header, length = container.read_header(stream, size)
    if container.operation(header) != container.BAG:
        raise DamagedBagError("it does not begin with a bag header")
    if header.get(b"encryptor"):
        raise DamagedBagError("it is encrypted")
    start = stream.tell() + length
    position = int.from_bytes(container.field(header, b"index_pos"), "little")
    expected = tuple(container.uint32(container.field(header, name)) for name in (b"conn_count", b"chunk_count"))
    try:
        return _from_end(stream, size, position, expected)
    except DamagedBagError as error:
        why = "the recording was never finished" if position == 0 else f"its index cannot be read ({error})"
        index = _by_scanning(stream, size, start)
        index.losses.insert(0, f"{why}; what could be found by scanning was taken")
        return index


def _from_end(stream: BinaryIO, size: int, position: int, expected: tuple[int, ...]) -> BagIndex:
    if not 0 < position <= size:
        raise DamagedBagError("the file ends before it")
    index = BagIndex()
    stream.seek(position)
    while stream.tell() < size:
        header, length = container.read_header(stream, size)
        data = container.read_exactly(stream, length, size - stream.tell())
        kind = container.operation(header)
        if kind == container.CONNECTION:
            key, connection = container.parse_connection(header, memoryview(data))
            index.connections[key] = connection
        elif kind == container.CHUNK_INFO:
            index.chunks.append(container.parse_chunk_info(header, data))
    if (len(index.connections), len(index.chunks)) != expected:
        raise DamagedBagError(f"it lists {len(index.chunks)} of {expected[1]} chunks")
    if any(chunk.offset >= position for chunk in index.chunks):
        raise DamagedBagError("it names places behind the chunks")
    if not set(index.counts()) <= set(index.connections):
        raise DamagedBagError("it counts messages of connections that it does not list")
    return index


def _by_scanning(stream: BinaryIO, size: int, offset: int) -> BagIndex:
    """Chunks up to where the bag is cut or damaged; the counts are those of the index records behind each chunk."""
    index = BagIndex()
    try:
        while offset < size:
            stream.seek(offset)
            header, length = container.read_header(stream, size)
            kind, start = container.operation(header), stream.tell()
            if kind == container.CHUNK:
                _scan_chunk(stream, size, offset, index)
            elif kind == container.INDEX and index.chunks:
                data = container.read_exactly(stream, length, size - start)
                counts = index.chunks[-1].counts
                for key, count in container.index_counts(header, data).items():
                    counts[key] = max(counts.get(key, 0), count)
            elif kind == container.CONNECTION:
                data = container.read_exactly(stream, length, size - start)
                key, connection = container.parse_connection(header, memoryview(data))
                index.connections.setdefault(key, connection)
            offset = start + length
        if offset > size:
            index.losses.append(f"the file is cut at byte {size}, within a chunk; what follows is lost")
    except DamagedBagError as error:
        index.losses.append(f"at byte {offset} of {size}: {error}; what follows is lost")
    return index


def _scan_chunk(stream: BinaryIO, size: int, offset: int, index: BagIndex) -> None:
    messages, connections, _ = read_chunk(stream, size, offset)
    for key, connection in connections.items():
        index.connections.setdefault(key, connection)
    counts = Counter(message.connection_id for message in messages)
    first, last = (messages[0].time_ns, messages[-1].time_ns) if messages else (0, 0)
    index.chunks.append(ChunkInfo(offset, first, last, dict(counts)))


def read_chunk(
    stream: BinaryIO, size: int, offset: int
) -> tuple[list[BagMessage], dict[int, BagConnection], str | None]:
    """Messages of the chunk at an offset by time, its connections, and what was wrong with it, None for nothing."""
    try:
        content, whole = _content(stream, size, offset)
    except DamagedBagError as error:
        return [], {}, str(error)
    messages, connections, problem = container.parse_chunk(content)
    messages.sort(key=lambda message: message.time_ns)
    return messages, connections, problem or (None if whole else "it is cut")


def _content(stream: BinaryIO, size: int, offset: int) -> tuple[memoryview, bool]:
    stream.seek(offset)
    header, length = container.read_header(stream, size)
    if container.operation(header) != container.CHUNK:
        raise DamagedBagError("there is no chunk where the index says")
    return container.decompress(header, stream.read(min(length, size - stream.tell())))
