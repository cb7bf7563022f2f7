"""How the chunks of a recording look: how large they are, and how they are compressed."""

from array import array
from collections import defaultdict
from dataclasses import dataclass, field

CHUNK_BYTES = 1 << 20
CHUNK_NS = 5 * 10**9
"""Where a chunk ends: between 256 KiB and 4 MiB size hardly matters, and those that overlap for longer cost memory."""


@dataclass(frozen=True, slots=True)
class ChunkForm:
    """Chunks of about `size_bytes` before compression by zstd, lz4 or none; images only if it is for them."""

    compression: str = "zstd"
    size_bytes: int = CHUNK_BYTES
    is_for_images: bool = True

    def compresses(self, *, is_image: bool) -> bool:
        """Whether a chunk of images, or of other messages, is compressed."""
        return self.compression != "none" and (self.is_for_images or not is_image)


Buffer = bytes | bytearray | memoryview
LARGE_BYTES = 1 << 14
"""Payloads from this size on stay where they are, if nothing else lies there: to copy them would take longer."""


@dataclass(slots=True)
class OpenChunk:
    """Messages on their way into one chunk of the file: `size` bytes, in `large` pieces and those in `data` behind."""

    compressed: bool
    data: bytearray = field(default_factory=bytearray)
    large: list[Buffer] = field(default_factory=list)
    size: int = 0
    start_ns: int = 2**64 - 1
    end_ns: int = 0
    index: "defaultdict[int, array[int]]" = field(default_factory=lambda: defaultdict(lambda: array("Q")))

    def take(self, head: bytes, payload: bytes) -> None:
        """Add a message with a large payload."""
        self.data += head
        self.large += (self.data, payload)
        self.data = bytearray()

    @property
    def pieces(self) -> list[Buffer]:
        """All that is in it."""
        return [*self.large, self.data] if self.data or not self.large else self.large
