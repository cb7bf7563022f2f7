"""A log whose videos are seen as images: what builds on earlier packets is decoded in one pass over all of them.

Decoding happens where a log is read for a stage, and not in `convert`: a video stays as small as it was recorded and
loses nothing once more, which it would as JPEG, and `--image-rate` leaves out pictures after they were decoded. Reading
that begins within a video begins with its next key frame.
"""

import heapq
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import takewhile
from operator import attrgetter

from mcap_landmarks.channels import RESULTS
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.messages.video import CompressedVideo, TheoraPacket, codec_of
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.layered_log import Layer, LayeredLog
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage
from mcap_landmarks.vision.pixels import Rgb
from mcap_landmarks.vision.video_decoder import VideoDecoder
from mcap_landmarks.wording import counted

_Piece = CompressedVideo | TheoraPacket | CompressedImage
_VIDEOS: Mapping[str, type[CompressedVideo] | type[TheoraPacket]] = {
    message.ROS_TYPE: message for message in (CompressedVideo, TheoraPacket)
}
_PICTURES = (Image.ROS_TYPE, CompressedImage.ROS_TYPE)


def videos_of(recording: Recording, choice: Choice) -> dict[Connection, Connection]:
    """The connections of a recording that are seen as images, each with the one that stands for it.

    Those are CompressedImages with the packets of a video, and where there are no other images, or where the user chose
    them, the videos of other messages: image_transport sends a camera's images in several forms at once.
    """
    own = [entry.connection for entry in recording.channels if entry.count]
    found = _videos(recording, [one for one in own if not one.topic.startswith(RESULTS)], choice)
    schema = definition(Image.ROS_TYPE).encode()
    return {one: Connection(one.topic, Image.ROS_TYPE, schema, metadata=one.metadata) for one in found}


def _videos(recording: Recording, own: Sequence[Connection], choice: Choice) -> list[Connection]:
    pictures = [connection for connection in own if connection.read_as in _PICTURES]
    videos = [connection for connection in own if connection.read_as in _VIDEOS]
    found = [connection for connection in pictures if _is_video(recording, connection)]
    return [*found, *(one for one in videos if not pictures or _is_chosen(one, choice))]


def _is_chosen(connection: Connection, choice: Choice) -> bool:
    topic = choice.remaps.get(connection.topic, connection.topic)
    return topic in {*choice.images, choice.topics.get("image", "")}


def _is_video(recording: Recording, connection: Connection) -> bool:
    """Whether the first message of a connection is a packet of a video."""
    first = next(recording.messages([connection]), None) if connection.read_as == CompressedImage.ROS_TYPE else None
    try:
        return first is not None and codec_of(decode(CompressedImage, first.data).format) is not None
    except MessageError:
        return False


class ScreenedLog(LayeredLog):
    """Layers that are read as one recording, whose videos are images; `videos` are those of `videos_of`."""

    def __init__(self, path: Location, layers: Sequence[Layer], videos: Mapping[Connection, Connection]) -> None:
        super().__init__(path, layers)
        there = {entry.connection for entry in self.channels}
        self._videos = {video: seen for video, seen in videos.items() if video in there}
        self._recorded = {seen: video for video, seen in self._videos.items()}
        self.channels = tuple(
            ChannelSummary(self._videos.get(entry.connection, entry.connection), entry.count) for entry in self.channels
        )
        self._lost: dict[str, dict[tuple[int, int], MessageError]] = {}

    @property
    def losses(self) -> list[str]:
        """What could not be read so far."""
        found = super().losses
        for topic, lost in self._lost.items():
            first = next(iter(lost.values()))
            found.append(f"{topic}: {counted(len(lost), 'message')} of its video without a picture: {first}")
        return found

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Recording.messages`; those of videos have their pictures."""
        wanted = {entry.connection for entry in self.channels} if connections is None else {*connections}
        streams = [self._seen(seen, start_ns, end_ns, progress) for seen in self._videos.values() if seen in wanted]
        if not streams:
            return super().messages(connections, start_ns, end_ns, progress)
        streams.append(super().messages(wanted - self._recorded.keys(), start_ns, end_ns, progress))
        return heapq.merge(*streams, key=attrgetter("log_time_ns"))

    def count(self, connections: Collection[Connection], start_ns: int | None, end_ns: int | None) -> int:
        """See `LayeredLog.count`."""
        return super().count(self._as_recorded(connections), start_ns, end_ns)

    def size_bytes(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> int:
        """See `Recording.size_bytes`."""
        recorded = None if connections is None else self._as_recorded(connections)
        return super().size_bytes(recorded, start_ns, end_ns)

    def _as_recorded(self, connections: Collection[Connection]) -> list[Connection]:
        return [self._recorded.get(one, one) for one in connections]

    def _seen(
        self,
        seen: Connection,
        start_ns: int | None,
        end_ns: int | None,
        progress: Progress | None,
    ) -> Iterator[RawMessage]:
        """The pictures of a video as messages of images, in the order of its packets."""
        video, waiting, decoder = self._recorded[seen], deque[tuple[RawMessage, _Piece]](), _Decoder(self.path)
        if start_ns is not None and video.read_as == TheoraPacket.ROS_TYPE:  # its headers come once
            earlier = (_piece(video, raw) for raw in super().messages([video], None, start_ns))
            for header in takewhile(_is_header, earlier):
                deque(decoder.take(header), maxlen=0)
        for raw in super().messages([video], start_ns, end_ns, progress):
            try:
                piece = _piece(video, raw)
            except MessageError as error:
                self._lose(raw, error)
                continue
            pictures = decoder.take(piece)
            if not _is_header(piece):
                waiting.append((raw._replace(connection=seen, data=b""), piece))
            yield from self._shown(waiting, pictures)
        yield from self._shown(waiting, decoder.finish())

    def _shown(
        self, waiting: deque[tuple[RawMessage, _Piece]], pictures: Iterator[Rgb | MessageError]
    ) -> Iterator[RawMessage]:
        for picture in pictures:
            raw, piece = waiting.popleft()
            if isinstance(picture, MessageError):
                self._lose(raw, picture)
                continue
            height, width, _ = picture.shape
            where = piece.stamp_ns, piece.frame_id
            image = Image(*where, height, width, "rgb8", is_bigendian=False, step=3 * width, data=picture.tobytes())
            yield raw._replace(data=encode(image))

    def _lose(self, raw: RawMessage, error: MessageError) -> None:
        lost = self._lost.setdefault(raw.connection.topic, {})
        lost.setdefault((raw.log_time_ns, raw.sequence), error)


class _Decoder:
    """The decoder of a video, made when its first packet tells the codec, and anew where that changes."""

    def __init__(self, path: Location) -> None:
        self._path, self._form = path, ""
        self._decoder: VideoDecoder | None = None

    def take(self, piece: _Piece) -> Iterator[Rgb | MessageError]:
        """Add a packet; see `VideoDecoder`."""
        if piece.format != self._form or self._decoder is None:
            yield from self.finish()
            try:
                self._form, self._decoder = piece.format, VideoDecoder(piece.format)
            except RecordingError as error:
                raise RecordingError(f"{self._path}: {error}") from error
        decoder = self._decoder
        yield from decoder.take_theora(piece) if isinstance(piece, TheoraPacket) else decoder.take(piece.data)

    def finish(self) -> Iterator[Rgb | MessageError]:
        """What is left when all packets came."""
        return iter(()) if self._decoder is None else self._decoder.finish()


def _piece(video: Connection, raw: RawMessage) -> _Piece:
    """A message of a video.

    Raises:
        MessageError: it is none, or of a codec that is not read.
    """
    kind: type[_Piece] = _VIDEOS.get(video.read_as, CompressedImage)
    piece = decode(kind, raw.data)
    if codec_of(piece.format) is None:
        raise MessageError(f"{piece.format!r} is no video that is read, which are h264, h265, vp9, av1 and theora")
    return piece


def _is_header(piece: _Piece) -> bool:
    return isinstance(piece, TheoraPacket) and piece.is_header
