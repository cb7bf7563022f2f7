"""The images that go with each CameraInfo of a log: how large they are, and whether they are rectified."""

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

from mcap_landmarks.channels import CAMERA_IMAGE, RESULTS
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.fusion.camera_info import Size, in_image
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.cameras import IMAGES, info_topic, without_transport
from mcap_landmarks.inspection.topic_roles import Choice, choose
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.header import frame_in
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.stage import Connection, RawMessage, Readable
from mcap_landmarks.vision.image_size import image_size

_RECTIFIED = re.compile(r"(?:^|_)rect(?:ified)?(?:_|$)")
"""What the topics of rectified images are called by image_proc and drivers: image_rect, image_rect_color, rect_raw."""
_FIRST = 3
"""So many images are tried: the first may be cut short."""


@dataclass(frozen=True, slots=True)
class CameraImages:
    """The images of a CameraInfo: their topic, their size if that is known, and whether they are rectified.

    The size is that of the first ones, beside a CameraInfo of `info_px`: one of another size is of other images.
    """

    topic: str
    size_px: Size | None
    rectified: bool
    info_px: Size | None = field(default=None, compare=False)

    def read(self, info: CameraInfo) -> CameraInfo:
        """A CameraInfo as that of these images.

        Raises:
            RecordingError: see `in_image`.
        """
        is_known = self.info_px in (None, (info.width_px, info.height_px))
        return replace(in_image(info, self.size_px if is_known else None), of_rectified=self.rectified)

    def notes(self, topic: str, info: CameraInfo) -> list[str]:
        """What is to be said of how a CameraInfo on a topic is read; nothing where that is as usual."""
        found = []
        if self.size_px is not None and max(info.binning) > 1 and self.size_px == (info.width_px, info.height_px):
            size = f"{info.width_px} x {info.height_px}"
            found.append(
                f"{topic} says binning {info.binning[0]} x {info.binning[1]}, but is of the images as they are ({size})"
            )
        if self.rectified:
            found.append(f"{self.topic} has rectified images by its name: P of {topic} counts, and no distortion")
        return found


def is_rectified(topic: str) -> bool:
    """Whether a topic's name says that its images are rectified."""
    return _RECTIFIED.search(without_transport(topic).rpartition("/")[2]) is not None


def images_of(recording: Readable, choice: Choice, infos: Sequence[Connection]) -> dict[Connection, CameraImages]:
    """The images that go with some CameraInfos, none for one that no images go with, or several kinds of them."""
    frames = {_named(entry, choice): _frame(recording, entry) for entry in infos}
    beside: dict[str, list[CameraImages]] = {}
    images = _images(recording, choice)
    for entry in images:
        topic = _named(entry, choice)
        info = info_topic(topic, _frame(recording, entry), frames)
        if info is None and len(frames) == 1 and len(images) == 1:
            info = next(iter(frames))
        if info is not None:
            one = CameraImages(topic, first_size(recording, entry), is_rectified(topic))
            beside.setdefault(info, []).append(one)
    alone = {
        info: found[0] for info, found in beside.items() if len({(one.size_px, one.rectified) for one in found}) == 1
    }
    return {
        entry: replace(alone[_named(entry, choice)], info_px=_info_size(recording, entry))
        for entry in infos
        if _named(entry, choice) in alone
    }


def _info_size(recording: Readable, connection: Connection) -> Size | None:
    """The size that the first CameraInfo of a connection says."""
    try:
        info = decode(CameraInfo, next(iter(recording.messages([connection]))).data)
    except (MessageError, StopIteration):
        return None
    return info.width_px, info.height_px


def first_calibrated(recording: Readable, connection: Connection) -> RawMessage | None:
    """The first CameraInfo of a connection that has a focal length; None where none has."""
    for raw in recording.messages([connection]):
        with contextlib.suppress(MessageError):
            if decode(CameraInfo, raw.data).is_calibrated:
                return raw
    return None


def first_size(recording: Readable, connection: Connection) -> Size | None:
    """The size of the first images of a connection that can be read."""
    for raw in islice(recording.messages([connection]), _FIRST if connection.read_as in IMAGES else 0):
        try:
            size = image_size(decode(IMAGES[connection.read_as], raw.data))
        except MessageError:
            continue
        if size is not None:
            return size
    return None


def _images(recording: Readable, choice: Choice) -> Sequence[Connection]:
    """The images that were chosen, all where none were and several could be."""
    try:
        return choose(recording, CAMERA_IMAGE, choice)
    except UsageError:
        every = [entry.connection for entry in recording.channels]
        return [one for one in every if one.read_as in IMAGES and not one.topic.startswith(RESULTS)]


def _named(connection: Connection, choice: Choice) -> str:
    return choice.remaps.get(connection.topic, connection.topic)


def _frame(recording: Readable, connection: Connection) -> str:
    first = next(iter(recording.messages([connection])), None)
    return "" if first is None else plain(frame_in(first.data))
