"""Whether the CameraInfo of every camera tells what its images show: asked before hours are spent on them."""

from collections.abc import Iterator

from mcap_landmarks.channels import CAMERA_INFO
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.fusion.camera_info import NO_INFO
from mcap_landmarks.fusion.camera_view import camera_from_info
from mcap_landmarks.inspection.camera_images import CameraImages, first_calibrated, images_of, is_rectified
from mcap_landmarks.inspection.cameras import info_topic
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.survey import Survey
from mcap_landmarks.inspection.topic_roles import Choice, choose
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.stage import Connection, Readable


def refuse_cameras(recording: Readable, choice: Choice, rectified: bool | None) -> None:
    """Refuse a log whose cameras cannot be understood; `rectified` is what the user said of their images.

    Where boxes lie ready-made beside several CameraInfos, one that can be used is enough.

    Raises:
        RecordingError: there is no CameraInfo, it is zero or not finite, or of another size than the images.
        UsageError: see `choose`.
    """
    infos = choose(recording, CAMERA_INFO, choice)
    images = images_of(recording, choice, infos)
    errors = [error for entry in infos if (error := _error(recording, entry, images.get(entry), rectified)) is not None]
    if not infos:
        raise RecordingError(f"{recording.path}: {NO_INFO}")
    if errors and (len(errors) == len(infos) or (choice.images and len(images) == len(infos))):
        raise RecordingError(f"{recording.path}: {errors[0]}")


def _error(
    recording: Readable, connection: Connection, images: CameraImages | None, rectified: bool | None
) -> str | None:
    raw = first_calibrated(recording, connection) or next(iter(recording.messages([connection])), None)
    if raw is None:
        return f"{connection.topic} has no messages; {NO_INFO.partition('; ')[2]}"
    try:
        info = decode(CameraInfo, raw.data)
        camera_from_info(info if images is None else images.read(info), rectified=rectified)
    except (MessageError, RecordingError) as error:
        return f"{connection.topic}: {error}"
    return None


def check_camera_infos(found: Survey) -> Iterator[Finding]:
    """The CameraInfos that are refused by what needs them."""
    images, frames = found.of("image"), {sensor.topic: sensor.frame for sensor in found.of("camera_info")}
    for topic, info in sorted(found.infos.items()):
        beside = [one for one in images if info_topic(one.topic, one.frame, frames) == topic]
        beside = beside or (images if len(images) == len(frames) == 1 else [])
        sizes = {found.image_px.get(one.topic) for one in beside}
        rectified = bool(beside) and all(is_rectified(one.topic) for one in beside)
        size_px = sizes.pop() if len(sizes) == 1 else None
        try:
            camera_from_info(CameraImages("", size_px, rectified).read(info), rectified=None)
        except RecordingError as error:
            text, _, remedy = str(error).partition("; ")
            yield Finding("problem", "camera", topic, text, remedy)
