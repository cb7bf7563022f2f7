"""Videos to pictures with PyAV: packets in their order in, pictures in the same order out."""

import importlib
from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.messages.video import TheoraPacket, codec_of
from mcap_landmarks.vision.pixels import Rgb

if TYPE_CHECKING:
    from av.video.codeccontext import VideoCodecContext

_MOST_WAITING = 32
"""A picture that has not come after so many packets never will: H.264 and H.265 hold back 16 pictures at most."""
_MOST_PIXELS = 35_651_584
"""The largest pictures that H.264, H.265 and AV1 have in their highest level (6.2); larger ones are not decoded."""
_HEADERS = 3
_FIRST_HEADER = 0x80
_NO_KEY_FRAME, _NO_PICTURE = "no key frame came before it", "no picture came of it"
INSTALL = "pip install 'mcap-landmarks[video]'"


class VideoDecoder:
    """The pictures of one video. Every packet gives one in its turn, or a MessageError that says why it has none.

    Nothing comes before the first key frame: no picture is whole until then. One thread decodes, so that the same
    packets give the same pictures.

    Raises:
        RecordingError: PyAV is not installed, or its FFmpeg lacks the codec.
    """

    def __init__(self, form: str) -> None:
        try:
            self._av = importlib.import_module("av")
        except ImportError as error:
            raise RecordingError(f"{form} video is read with PyAV, which is not installed; {INSTALL}") from error
        self._form, self._is_whole = form.lower(), False
        self._waiting: deque[Rgb | MessageError | None] = deque()
        self._first = 0
        self._headers: list[bytes] = []
        self._number: int | None = None
        self._codec = None if self._form == "theora" else self._opened()

    def take(self, packet: bytes) -> Iterator[Rgb | MessageError]:
        """Add a packet; what is known now of the packets so far, in their order."""
        self._waiting.append(None)
        if not packet:
            self._waiting[-1] = MessageError("the packet is empty")
        elif self._codec is None:
            self._waiting[-1] = MessageError("the headers of the video did not come before it")
        else:
            self._decode(packet, self._first + len(self._waiting) - 1)
        yield from self._known(_MOST_WAITING)

    def take_theora(self, packet: TheoraPacket) -> Iterator[Rgb | MessageError]:
        """Add a packet of theora; headers give nothing, and after a gap pictures begin with the next key frame."""
        if packet.is_header:
            is_first = packet.data[0] == _FIRST_HEADER
            self._headers = [packet.data] if is_first else [*self._headers, packet.data]
            if len(self._headers) == _HEADERS:
                yield from self.finish()
                self._codec, self._is_whole = self._opened(), False
        else:
            self._is_whole &= self._number is None or packet.number == self._number + 1
            yield from self.take(packet.data)
        self._number = packet.number

    def finish(self) -> Iterator[Rgb | MessageError]:
        """What is left when all packets came."""
        if self._codec is not None and self._waiting:
            self._decode(None, 0)
        yield from self._known(0)

    def _opened(self) -> "VideoCodecContext":
        try:
            codec: VideoCodecContext = self._av.CodecContext.create(codec_of(self._form), "r")
        except ValueError as error:
            raise RecordingError(f"{self._form} video is not read by this PyAV; {INSTALL}") from error
        codec.thread_count, codec.options = 1, {"max_pixels": str(_MOST_PIXELS)}
        if self._headers:  # each after its length, as FFmpeg has the headers of Xiph's codecs
            codec.extradata = b"".join(len(header).to_bytes(2, "big") + header for header in self._headers)
        return codec

    def _decode(self, data: bytes | None, index: int) -> None:
        """Decode a packet, or what is left; pictures go where their packets are waiting."""
        assert self._codec is not None  # noqa: S101 - as the callers see to it
        packet = None
        if data is not None:
            packet = self._av.Packet(data)
            packet.pts = index
        try:
            frames = self._codec.decode(packet)
        except self._av.FFmpegError as error:
            if data is not None:
                reason = f"the packet cannot be decoded: {error.strerror}" if self._is_whole else _NO_KEY_FRAME
                self._waiting[-1] = MessageError(reason)
            return
        for frame in frames:
            place = -1 if frame.pts is None else frame.pts - self._first
            self._is_whole |= bool(frame.key_frame)
            if not 0 <= place < len(self._waiting):
                continue
            if not self._is_whole:
                self._waiting[place] = MessageError(_NO_KEY_FRAME)
            elif frame.is_corrupt:
                self._waiting[place] = MessageError("it is damaged, or one that it builds on")
            else:
                self._waiting[place] = np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)

    def _known(self, most: int) -> Iterator[Rgb | MessageError]:
        while self._waiting and (self._waiting[0] is not None or len(self._waiting) > most):
            found = self._waiting.popleft()
            self._first += 1
            yield MessageError(_NO_PICTURE if self._is_whole else _NO_KEY_FRAME) if found is None else found
