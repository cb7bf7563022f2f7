"""Messages outside chunks while a recording is scanned: those that follow each other become blocks."""

from mcap_landmarks.recording.container import MESSAGE, RECORD
from mcap_landmarks.recording.findings import Findings
from mcap_landmarks.recording.summary_index import Block

RUN_BYTES = 1 << 20
"""A run of messages outside chunks ends here, as our chunks do: each becomes one block, which is read whole."""


class LooseMessages:
    """Takes loose messages one by one, and puts blocks of them into the findings."""

    def __init__(self, found: Findings) -> None:
        self.last_offset: int | None = None
        self._found = found
        self._offset = self._end = self._last_channel = 0
        self._start_ns, self._end_ns = 2**64 - 1, 0

    def take(self, offset: int, length: int, fixed: bytes) -> None:
        """A message, of which `fixed` are the fields before its data."""
        _, _, channel_id, _, log_time, _ = MESSAGE.unpack(bytes(RECORD.size) + fixed)
        if self.last_offset is None:
            self._offset = offset
        self.last_offset, self._last_channel = offset, channel_id
        self._end = offset + RECORD.size + length
        self._start_ns, self._end_ns = min(self._start_ns, log_time), max(self._end_ns, log_time)
        self._found.counts[channel_id] += 1
        if self._end - self._offset >= RUN_BYTES:
            self.close()

    def drop_last(self) -> None:
        """Take back the last one, whose length proved wrong."""
        if self.last_offset is not None:
            self._found.counts[self._last_channel] -= 1
            self._end = self.last_offset

    def close(self) -> None:
        """End the run."""
        if self.last_offset is not None and self._end > self._offset:
            block = Block(self._offset, self._end - self._offset, self._start_ns, self._end_ns, is_chunk=False)
            self._found.add(block, is_verified=False)
        self.last_offset = None
        self._start_ns, self._end_ns = 2**64 - 1, 0
