"""The cameras of a log: which CameraInfo goes with which images, and the frame that tells each of them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.channels import RESULTS
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.header import frame_in
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.stage import Connection, Readable

ALL = "all"
"""Stands for every camera that has a CameraInfo of its own."""
_TRANSPORTS = ("compressed", "compressedDepth", "ffmpeg", "theora", "zstd")
"""Last parts of topics that image_transport and its plugins give to images in another form."""
_DEPTH = ("16UC1", "32FC1")
"""Encodings of depth images (REP 118)."""

Named = Sequence[tuple[str, Connection]]
"""Connections with the topics that they are read as."""


@dataclass(frozen=True, slots=True)
class Camera:
    """The topic of a camera's images, that of its CameraInfo if there is one, and the frame that tells the camera."""

    image: str
    info: str | None
    frame: str


@dataclass(frozen=True, slots=True)
class Cameras:
    """The cameras that are read, and why other topics of images are not, in words."""

    used: tuple[Camera, ...]
    left_out: tuple[str, ...] = ()

    def frames(self) -> dict[str, str]:
        """The frames of the cameras, by the topics of their images and their CameraInfos."""
        return {topic: one.frame for one in self.used for topic in (one.image, one.info) if topic is not None}

    def notes(self) -> tuple[str, ...]:
        """For the user: what was taken, and what not; nothing where there is nothing to choose."""
        if not self.used:
            return ()
        taken = [f"{one.image} ({one.info or 'no CameraInfo'}, frame {one.frame})" for one in self.used]
        return (f"images of {len(taken)} cameras: {', '.join(taken)}", *self.left_out)


NO_CAMERAS = Cameras(())
"""Where the user chose one image or none."""


def cameras(recording: Readable, named: Named, wanted: Sequence[str]) -> Cameras:
    """The cameras whose images are on some topics; `all` takes one topic of each that has a CameraInfo of its own.

    Raises:
        UsageError: a topic is missing or has no images, or two cameras have the same frame.
    """
    infos = _frames(recording, named, (CameraInfo.ROS_TYPE,))
    images = _frames(recording, named, (CompressedImage.ROS_TYPE, Image.ROS_TYPE))
    found = _with_info(recording, named, images, infos) if ALL in wanted else _wanted(recording, images, infos, wanted)
    _check_frames(recording, found.used)
    return found


def info_frames(recording: Readable, infos: Sequence[Connection]) -> dict[Connection, str]:
    """The frames of several CameraInfos, which tell whose boxes are; none of one.

    Raises:
        UsageError: two are of the same frame, and not the same.
    """
    if len({connection.topic for connection in infos}) < 2:
        return {}
    firsts: dict[str, tuple[str, CameraInfo]] = {}
    frames = {}
    for connection in infos:
        raw = next(iter(recording.messages([connection])), None)
        info = None if raw is None else decode(CameraInfo, raw.data)
        if info is None:
            continue
        frames[connection] = frame = plain(info.frame_id)
        topic, other = firsts.setdefault(frame, (connection.topic, info))
        if not _same_optics(info, other):
            raise UsageError(
                f"{recording.path}: {topic} and {connection.topic} are both of the frame {frame}, and not the same; "
                "choose the images that boxes are of with --image TOPIC"
            )
    return frames


def _same_optics(info: CameraInfo, other: CameraInfo) -> bool:
    return (info.width_px, info.height_px, info.distortion_model) == (
        other.width_px,
        other.height_px,
        other.distortion_model,
    ) and all(
        np.array_equal(getattr(info, name), getattr(other, name)) for name in ("distortion", "intrinsics", "projection")
    )


def without_transport(image: str) -> str:
    """The topic of images without what image_transport adds for another form of them."""
    base, _, last = image.rpartition("/")
    return base if last in _TRANSPORTS else image


def info_topic(image: str, frame: str, infos: Mapping[str, str]) -> str | None:
    """The topic of the CameraInfo of images on a topic and in a frame; `infos` are frames by topic.

    By ROS's convention it is called `camera_info` and lies beside the images; else it is the only one in their frame.
    """
    base = without_transport(image)
    beside = [topic for topic in (f"{base.rpartition('/')[0]}/camera_info", f"{base}/camera_info") if topic in infos]
    same = [topic for topic in infos if frame and infos[topic] == frame]
    both = [topic for topic in beside if topic in same]
    return next(iter(both or beside or (same if len(same) == 1 else [])), None)


def _frames(recording: Readable, named: Named, types: Collection[str]) -> dict[str, str]:
    """The frames of the first messages of some types, by topic."""
    found = {}
    for topic, connection in named:
        if connection.read_as in types and not topic.startswith(RESULTS) and topic not in found:
            first = next(iter(recording.messages([connection])), None)
            found[topic] = "" if first is None else plain(frame_in(first.data))
    return dict(sorted(found.items()))


def _wanted(recording: Readable, images: Mapping[str, str], infos: Mapping[str, str], wanted: Sequence[str]) -> Cameras:
    missing = [topic for topic in wanted if topic not in images]
    if missing:
        raise UsageError(
            f"{recording.path}: there are no images on {' and '.join(missing)} for --image; mcap-landmarks info lists "
            "the topics"
        )
    return Cameras(tuple(_camera(topic, images, infos) for topic in dict.fromkeys(wanted)))


def _camera(topic: str, images: Mapping[str, str], infos: Mapping[str, str]) -> Camera:
    info = info_topic(topic, images[topic], infos)
    return Camera(topic, info, (infos[info] if info is not None else "") or images[topic])


def _with_info(recording: Readable, named: Named, images: Mapping[str, str], infos: Mapping[str, str]) -> Cameras:
    """One topic of images of every CameraInfo: of several the one in its frame, else the first by name."""
    used, left_out = dict[str, Camera](), list[str]()
    depth = _depth_topics(recording, named)
    # Those in the frame of their CameraInfo first: it can lie beside the images of another camera as well.
    found = [_camera(topic, images, infos) for topic in images]
    for one in sorted(found, key=lambda one: images[one.image] != one.frame):
        if one.image in depth:
            left_out.append(f"{one.image} is left out: it has depth images")
        elif one.info is None:
            left_out.append(f"{one.image} is left out: it has no CameraInfo of its own")
        elif one.info in used:
            left_out.append(f"{one.image} is left out: {one.info} goes with {used[one.info].image}")
        else:
            used[one.info] = one
    if not used:
        raise UsageError(
            f"{recording.path}: no camera has a CameraInfo of its own for --image {ALL}; {'; '.join(left_out)}"
        )
    return Cameras(tuple(sorted(used.values(), key=lambda one: one.image)), tuple(sorted(left_out)))


def _depth_topics(recording: Readable, named: Named) -> set[str]:
    """The topics with images whose pixels are distances."""
    found = set()
    for topic, connection in named:
        form = ""
        for raw in recording.messages([connection]) if connection.read_as in IMAGES else ():
            try:
                message = decode(IMAGES[connection.message_type], raw.data)
            except MessageError:
                continue
            form = message.format if isinstance(message, CompressedImage) else message.encoding
            break
        if form in _DEPTH or "compressedDepth" in form:
            found.add(topic)
    return found


IMAGES: Mapping[str, type[Image] | type[CompressedImage]] = {
    message.ROS_TYPE: message for message in (CompressedImage, Image)
}
"""The messages that are images, by type."""


def _check_frames(recording: Readable, used: Sequence[Camera]) -> None:
    """Boxes are told apart by the frames of their cameras."""
    by_frame: dict[str, list[str]] = {}
    for one in used:
        by_frame.setdefault(one.frame, []).append(one.image)
    for frame, topics in by_frame.items():
        if len(topics) > 1:
            where = f"the frame {frame}" if frame else "no frame"
            raise UsageError(
                f"{recording.path}: {' and '.join(topics)} are of {where}, so nothing tells where each camera is; "
                "choose one of them with --image, or give every camera a frame of its own in its CameraInfo"
            )
