"""From a file's name to the index of the recording in it, or to a refusal that names the file."""

from struct import error as struct_error
from typing import BinaryIO

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import Location, open_to_read
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.container import MAGIC, RECORD, Opcode, parse
from mcap_landmarks.recording.reading_ahead import gather_ends
from mcap_landmarks.recording.rebuild_index import index_by_scanning
from mcap_landmarks.recording.record_shapes import check_content
from mcap_landmarks.recording.summary_index import Index, index_from_summary, read_record


def open_stream(path: Location) -> BinaryIO:
    """The bytes of a file.

    Raises:
        RecordingError: there is none, or it may not be read.
        RemoteError: the same of a file elsewhere.
    """
    try:
        return open_to_read(path)
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: there is no such file; check the path") from error
    except IsADirectoryError as error:
        raise RecordingError(
            f"{path} is a folder; convert it first: mcap-landmarks convert {path} -o LOG.mcap"
        ) from error
    except PermissionError as error:
        raise RecordingError(f"{path} may not be read; change its permissions") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); check the path") from error


def index_of(path: Location, stream: BinaryIO, *, from_front: bool, progress: Progress | None = None) -> Index:
    """What a recording holds and where: from its summary, or by reading it from the front where that cannot be used.

    Raises:
        RecordingError: it is no MCAP file.
    """
    size = stream.seek(0, 2)
    stream.seek(0)
    if size == 0:
        raise RecordingError(f"{path} is empty (0 bytes); record or copy it again")
    gather_ends(stream, size)
    if not begins_or_ends(stream, size):
        raise RecordingError(f"{path} is not an MCAP file; mcap-landmarks convert reads bags and data sets")
    if size == len(MAGIC):
        raise RecordingError(f"{path} ends within its MCAP header; copy it again")
    try:
        opcode, content = read_record(stream, len(MAGIC))
        check_content(Opcode.HEADER if opcode == Opcode.HEADER else 0, content)
        header = parse(records.Header, content)
    except (EOFError, McapError, struct_error, ValueError, MemoryError, OverflowError):
        return _without_header(path, stream, size)
    if from_front:
        return index_by_scanning(stream, size, header, progress=progress)
    index = index_from_summary(stream, size, header, len(MAGIC) + RECORD.size + len(content))
    return index_by_scanning(stream, size, header, index, progress) if isinstance(index, str) else index


def begins_or_ends(stream: BinaryIO, size: int) -> bool:
    """Whether a file begins with MCAP's magic bytes; or ends so: the first ones may be what is damaged."""
    stream.seek(0)
    if stream.read(len(MAGIC)) == MAGIC:
        return True
    stream.seek(max(size - len(MAGIC), 0))
    return size > 2 * len(MAGIC) and stream.read(len(MAGIC)) == MAGIC


def _without_header(path: Location, stream: BinaryIO, size: int) -> Index:
    """The index of a file whose header is damaged: what comes behind that can be sound all the same."""
    remark = "its header is damaged, which names the profile"
    index = index_by_scanning(stream, size, records.Header(profile="", library=""), remark)
    if not index.channels:
        raise RecordingError(f"{path} ends within its MCAP header, or holds nothing behind it; copy it again")
    return index
