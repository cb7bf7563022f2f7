"""Which images a CameraInfo is of, how large they are, and whether their topic says that they are rectified."""

from dataclasses import replace
from pathlib import Path

import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.camera_checks import refuse_cameras
from mcap_landmarks.inspection.camera_images import CameraImages, images_of, is_rectified
from mcap_landmarks.inspection.topic_roles import Choice, choose
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.logs import write
from tests.runs.chain import raw_messages


@pytest.mark.parametrize(
    ("topic", "expected"),
    [
        ("/camera/image_rect", True),
        ("/camera/image_rect_color/compressed", True),
        ("/infra1/image_rect_raw", True),
        ("/left/image_rectified", True),
        ("/camera/image_raw", False),
        ("/rect/image_raw/compressed", False),
        ("/camera/image_unrect", False),
        ("/camera/direct", False),
    ],
)
def test_the_name_of_a_topic_says_whether_its_images_are_rectified(topic: str, expected: bool) -> None:
    assert is_rectified(topic) is expected


def log(path: Path, image: str = CAMERA_IMAGE.topic, width_px: int = 64, *, more: tuple[Stamped, ...] = ()) -> Path:
    def moved(stamped: Stamped) -> Stamped:
        message: Message = stamped.message
        if isinstance(message, CompressedImage):
            return Stamped(Channel(image, CompressedImage), stamped.log_time_ns, message)
        if isinstance(message, CameraInfo):
            return Stamped(CAMERA_INFO, stamped.log_time_ns, replace(message, width_px=width_px))
        return stamped

    return write(path, [*more, *map(moved, raw_messages(2))])


@pytest.mark.parametrize(("image", "rectified"), [(CAMERA_IMAGE.topic, False), ("/webcam/image_rect", True)])
def test_the_only_camera_has_its_images_wherever_they_are(tmp_path: Path, image: str, rectified: bool) -> None:
    with open_recording(log(tmp_path / "log.mcap", image)) as recording:
        (found,) = images_of(recording, Choice(), choose(recording, CAMERA_INFO, Choice())).values()
        assert found == CameraImages(image, (64, 48), rectified)


def test_images_of_several_sizes_tell_nothing_until_one_is_chosen(tmp_path: Path) -> None:
    small = Channel("/camera/image_rect/compressed", CompressedImage)
    other = Stamped(
        small, 1, CompressedImage(1, "camera", "png", b"\x89PNG\r\n\x1a\n" + bytes(8) + b"\0\0\0\x20\0\0\0\x18")
    )
    with open_recording(log(tmp_path / "log.mcap", more=(other,))) as recording:
        infos = choose(recording, CAMERA_INFO, Choice({"image": CAMERA_IMAGE.topic}))
        assert images_of(recording, Choice(), infos) == {}
        (found,) = images_of(recording, Choice({"image": small.topic}), infos).values()
        assert found == CameraImages(small.topic, (32, 24), rectified=True)


def test_a_camera_of_another_size_is_refused_with_its_topic(tmp_path: Path) -> None:
    with open_recording(log(tmp_path / "good.mcap")) as recording:
        refuse_cameras(recording, Choice(), None)
    with (
        open_recording(log(tmp_path / "wide.mcap", width_px=128)) as recording,
        pytest.raises(
            RecordingError, match=r"wide.mcap: /camera/camera_info: .*128 x 48 pixels, but .* 64 x 48; record"
        ),
    ):
        refuse_cameras(recording, Choice(), None)
