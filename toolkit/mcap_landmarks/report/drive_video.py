"""A video of a log with results, from file to file."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.recording.layered_log import Layer, LayeredLog
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.drive_moments import moments, readers
from mcap_landmarks.report.drive_pictures import DrivePictures
from mcap_landmarks.report.scan_points import static_frames
from mcap_landmarks.report.viewed_log import ViewedLog
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.stage import Connection
from mcap_landmarks.vision.video_encoder import create_video

_IMAGES: tuple[type[Message], ...] = (CompressedImage, Image)
_OF_ROLES = (*_IMAGES, LaserScan, MultiEchoLaserScan, Odometry)
"""Messages of which there may be several topics, and one is meant."""


@dataclass(frozen=True, slots=True)
class VideoForm:
    """Size in pixels, pictures per second, and the part of the log that a video shows."""

    size: tuple[int, int]
    fps: Fraction
    start_ns: int | None = None
    end_ns: int | None = None
    image: str | None = None


@dataclass(frozen=True, slots=True)
class VideoMade:
    """How many pictures a video has, the topics that it shows, and what of the log could not be read."""

    pictures: int
    topics: tuple[str, ...]
    losses: tuple[str, ...]


def make_video(path: Location, target: Path, form: VideoForm, progress: Callable[[int], None]) -> VideoMade:
    """Write the video of a log; `progress` is told the bytes that were read.

    Raises:
        ToolkitError: the log cannot be read, has nothing to show, or the video cannot be encoded.
    """
    result, reference, losses = read_run(path)
    with open_recording(path) as recording:
        view = ViewedLog(recording)
        topic = _image_topic(view, form.image)
        span = Span(Choice({"image": topic} if topic else {}), form.start_ns, form.end_ns)
        shown = RecordedLog(recording, span).layered([Layer(recording, recording.channels)])
        read_as = _shown(shown, view, topic)
        has_image = not {*read_as.values()}.isdisjoint(_IMAGES)
        pictures = DrivePictures.of(result, reference, form.size, has_image=has_image)
        raws = shown.messages(read_as, form.start_ns, form.end_ns, progress)
        count = 0
        with create_video(target, form.size, form.fps) as add:
            for now in moments(raws, read_as, static_frames(recording), view.base_frame, form.fps):
                add(pictures.draw(now))
                count += 1
        lost = dict.fromkeys([*losses, *shown.losses])
    if not count:
        where = "" if form.start_ns is None and form.end_ns is None else " between --start and --end"
        raise RecordingError(f"{path}: has no images, scans or poses to show{where}; name a log or a time with some")
    return VideoMade(count, tuple(sorted({one.topic for one in read_as})), tuple(lost))


def _image_topic(view: ViewedLog, asked: str | None) -> str | None:
    """The topic of the images that are shown, the first camera's where none is asked for.

    Raises:
        UsageError: the asked one has no messages.
    """
    if asked is None:
        return next((camera.image.topic for camera in view.cameras), None)
    if view.on(asked) is None:
        raise UsageError(
            f"{view.recording.path}: there is no topic {asked} for --image; mcap-landmarks info lists them"
        )
    return asked


def _shown(log: LayeredLog, view: ViewedLog, image: str | None) -> dict[Connection, type[Message]]:
    """What is shown of a log, and as which messages it is read: of several topics in a role the one that is meant."""
    meant = {image, *(one.topic for one in (*view.scans, *view.odometry))}
    known = readers(entry.connection for entry in log.channels if entry.count)
    return {one: message for one, message in known.items() if message not in _OF_ROLES or one.topic in meant}
