"""Messages of chunks so large that they could be millions, made one by one when they are asked for."""

from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from mcap_landmarks.memory import Lazily, is_small
from mcap_landmarks.recording.blocks import DamagedBlockError, records_in
from mcap_landmarks.recording.chunk_messages import messages_in
from mcap_landmarks.recording.container import MESSAGE, MESSAGE_FIXED, RECORD, Opcode
from mcap_landmarks.stage import Connection, RawMessage


def messages_of(wanted: Mapping[int, Connection], content: memoryview) -> tuple[Sequence[RawMessage], int]:
    """The wanted channels' messages by log time, see `messages_in`, and how many bytes they keep in memory."""
    return (messages_in if is_small(content) else many_messages_in)(content, wanted), len(content)


def many_messages_in(content: memoryview, wanted: Mapping[int, Connection]) -> Sequence[RawMessage]:
    """The wanted channels' messages by log time: only where they lie and when they were logged is kept.

    Raises:
        DamagedBlockError: a record runs over the end, or is too short for what it is.
    """
    unpack = MESSAGE.unpack_from
    starts, lengths, times = array("q"), array("q"), array("Q")
    for opcode, start, end in records_in(content):
        if opcode == Opcode.MESSAGE:
            if end - start < MESSAGE_FIXED:
                raise DamagedBlockError("a message in it is cut")
            _, _, channel_id, _, log_time, _ = unpack(content, start - RECORD.size)
            if channel_id in wanted:
                starts.append(start)
                lengths.append(end - start)
                times.append(log_time)

    def message(number: int) -> RawMessage:
        start = starts[number]
        _, _, channel_id, sequence, log_time, publish_time = unpack(content, start - RECORD.size)
        data = content[start + MESSAGE_FIXED : start + lengths[number]]
        return RawMessage(wanted[channel_id], log_time, publish_time, sequence, data)

    order = np.argsort(np.asarray(times), kind="stable").astype("<i8")
    return Lazily(array("q", order.tobytes()), message)
