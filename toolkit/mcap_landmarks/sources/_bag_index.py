"""What a ROS 1 bag holds and where: from the index at its end, or by scanning a bag that has none."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap_landmarks.sources import _bag_container as container
from mcap_landmarks.sources._bag_container import BagConnection, BagMessage, ChunkInfo, DamagedBagError
from mcap_landmarks.sources._bag_resync import next_record
from mcap_landmarks.sources._loss_account import LossAccount, LostStretch


@dataclass(slots=True)
class BagIndex:
    """Connections by id, chunks by time, and what is known to be lost: in words, and in the `account`.

    `damaged_at` is where the last chunk begins that was scanned, if that is damaged.
    """

    connections: dict[int, BagConnection] = field(default_factory=dict)
    chunks: list[ChunkInfo] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    account: LossAccount = field(default_factory=LossAccount)
    damaged_at: int | None = None

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
    _check_places(stream, size, position, index)
    if not set(index.counts()) <= set(index.connections):
        raise DamagedBagError("it counts messages of connections that it does not list")
    return index


def _check_places(stream: BinaryIO, size: int, position: int, index: BagIndex) -> None:
    """Refuse an index that does not name chunks one after the other, all before `position`.

    Raises:
        DamagedBagError: as it says.
    """
    end = 0
    for offset in sorted(chunk.offset for chunk in index.chunks):
        if offset < end:
            raise DamagedBagError("it names a chunk twice")
        stream.seek(min(offset, size))
        header, length = container.read_header(stream, size)
        end = stream.tell() + length
        if container.operation(header) != container.CHUNK or end > position:
            raise DamagedBagError("it names places where no chunk is")


def _by_scanning(stream: BinaryIO, size: int, offset: int) -> BagIndex:
    """All chunks that can be found; the counts are those of the index records behind each chunk.

    Behind what is damaged it goes on at the next record: from where the last chunk begins, if that is damaged too, for
    then its length may be wrong and hide others.
    """
    index = BagIndex()
    while offset < size:
        try:
            offset = _scan_record(stream, size, offset, index)
        except DamagedBagError as error:
            index.account.is_open = True
            search = offset if index.damaged_at is None else index.damaged_at
            found = next_record(stream, size, search + 1)
            if found is None:
                index.losses.append(f"at byte {offset} of {size}: {error}; what follows is lost")
                index.account.add("cut", None)
                return index
            begin = offset if found >= offset else search
            index.losses.append(f"{found - begin} bytes passed over from byte {begin} to byte {found} ({error})")
            index.account.passed_over.append(LostStretch(begin, found, str(error)))
            index.damaged_at = None
            offset = found
    if offset > size:
        index.losses.append(f"the file is cut at byte {size}, within a chunk; what follows is lost")
        index.account.add("cut", None)
        index.account.is_open = True
    return index


def _scan_record(stream: BinaryIO, size: int, offset: int, index: BagIndex) -> int:
    """Take the record at an offset; where it ends.

    Raises:
        DamagedBagError: there is none.
    """
    stream.seek(offset)
    header, length = container.read_header(stream, size)
    kind, start = container.operation(header), stream.tell()
    if kind == container.CHUNK:
        is_sound = _scan_chunk(stream, size, offset, index)
        index.damaged_at = None if is_sound else offset
        if not is_sound and start + length > size and next_record(stream, size, offset + 1) is not None:
            raise DamagedBagError(f"a chunk claims {length} bytes")
    elif kind == container.INDEX and index.chunks:
        counts = index.chunks[-1].counts
        data = container.read_exactly(stream, length, size - start)
        for key, count in container.index_counts(header, data).items():
            counts[key] = max(counts.get(key, 0), count)
    elif kind == container.CONNECTION:
        data = container.read_exactly(stream, length, size - start)
        key, connection = container.parse_connection(header, memoryview(data))
        index.connections.setdefault(key, connection)
    return start + length


def _scan_chunk(stream: BinaryIO, size: int, offset: int, index: BagIndex) -> bool:
    """Take the chunk at an offset; whether it is sound."""
    messages, connections, problem = read_chunk(stream, size, offset)
    for key, connection in connections.items():
        index.connections.setdefault(key, connection)
    counts = Counter(message.connection_id for message in messages)
    first, last = (messages[0].time_ns, messages[-1].time_ns) if messages else (0, 0)
    index.chunks.append(ChunkInfo(offset, first, last, dict(counts)))
    return problem is None


def read_chunk(
    stream: BinaryIO, size: int, offset: int
) -> tuple[Sequence[BagMessage], dict[int, BagConnection], str | None]:
    """Messages of the chunk at an offset by time, its connections, and what was wrong with it, None for nothing."""
    try:
        content, whole = _content(stream, size, offset)
    except DamagedBagError as error:
        return [], {}, str(error)
    messages, connections, problem = container.parse_chunk(content)
    return messages, connections, problem or (None if whole else "it is cut")


def _content(stream: BinaryIO, size: int, offset: int) -> tuple[memoryview, bool]:
    stream.seek(offset)
    header, length = container.read_header(stream, size)
    if container.operation(header) != container.CHUNK:
        raise DamagedBagError("there is no chunk where the index says")
    return container.decompress(header, stream.read(min(length, size - stream.tell())))
