"""Which CameraInfo goes with which images, and which cameras `all` means."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO
from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.cameras import Cameras, info_frames, info_topic
from mcap_landmarks.inspection.topic_roles import Choice, cameras_of, choose
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.logs import write


@pytest.mark.parametrize(
    ("image", "frame", "infos", "expected"),
    [
        ("/front/image_raw", "a", {"/front/camera_info": "a", "/rear/camera_info": "b"}, "/front/camera_info"),
        ("/front/image_raw/compressed", "", {"/front/camera_info": "a"}, "/front/camera_info"),
        ("/CAM_LEFT/image_rect_compressed", "x", {"/CAM_LEFT/camera_info": "CAM_LEFT"}, "/CAM_LEFT/camera_info"),
        ("/camera", "a", {"/camera/camera_info": "a"}, "/camera/camera_info"),
        ("/image_left", "left", {"/info_left": "left", "/info_right": "right"}, "/info_left"),
        ("/image_left", "left", {"/camera_info": "right", "/info_left": "left"}, "/camera_info"),
        ("/image_left", "left", {"/info_left": "left", "/info_again": "left"}, None),
        ("/front/image_raw", "a", {"/rear/camera_info": "b"}, None),
        ("/front/image_raw", "", {"/rear/camera_info": ""}, None),
    ],
)
def test_camera_info_lies_beside_its_images_or_is_in_their_frame(
    image: str, frame: str, infos: dict[str, str], expected: str | None
) -> None:
    assert info_topic(image, frame, infos) == expected


def picture(topic: str, frame: str, form: str = "jpeg") -> Stamped:
    if form in {"16UC1", "mono8"}:
        return Stamped(Channel(topic, Image), 1, Image(1, frame, 1, 1, form, False, 2, bytes(2)))
    return Stamped(Channel(topic, CompressedImage), 1, CompressedImage(1, frame, form, b""))


def info(topic: str, frame: str, focal_px: float = 60.0) -> Stamped:
    matrix = np.diag([focal_px, focal_px, 1.0])
    message = CameraInfo(1, frame, 48, 64, "plumb_bob", np.zeros(5), matrix, np.eye(3), np.eye(3, 4))
    return Stamped(Channel(topic, CameraInfo), 1, message)


def found(tmp_path: Path, content: Sequence[Stamped], *images: str) -> Cameras:
    with open_recording(write(tmp_path / "log.mcap", list(content))) as recording:
        return cameras_of(recording, Choice(images=images))


CAMPUS = [
    info("/front/camera_info", "front_optical"),
    picture("/front/image_raw", "front"),
    picture("/front/image_raw/compressed", "front"),
    info("/rear/camera_info", "rear_optical"),
    picture("/rear/image_raw", "rear"),
    info("/depth/camera_info", "depth"),
    picture("/depth/image_rect_raw", "depth", "16UC1"),
    picture("/depth/image/compressedDepth", "depth", "16UC1; compressedDepth"),
    picture("/webcam/image", "webcam"),
]


def test_all_means_one_topic_of_every_camera_that_can_be_fused(tmp_path: Path) -> None:
    cameras = found(tmp_path, CAMPUS, "all")
    assert [(one.image, one.info, one.frame) for one in cameras.used] == [
        ("/front/image_raw", "/front/camera_info", "front_optical"),
        ("/rear/image_raw", "/rear/camera_info", "rear_optical"),
    ]
    taken, *left_out = cameras.notes()
    assert taken == (
        "images of 2 cameras: /front/image_raw (/front/camera_info, frame front_optical), "
        "/rear/image_raw (/rear/camera_info, frame rear_optical)"
    )
    assert left_out == [
        "/depth/image/compressedDepth is left out: it has depth images",
        "/depth/image_rect_raw is left out: it has depth images",
        "/front/image_raw/compressed is left out: /front/camera_info goes with /front/image_raw",
        "/webcam/image is left out: it has no CameraInfo of its own",
    ]


def test_a_camera_info_between_the_images_of_two_cameras_is_of_that_in_its_frame(tmp_path: Path) -> None:
    content = [info("/camera_info", "right"), picture("/image_left", "left"), picture("/image_right", "right")]
    cameras = found(tmp_path, content, "all")
    assert [one.image for one in cameras.used] == ["/image_right"]
    assert cameras.left_out == ("/image_left is left out: /camera_info goes with /image_right",)


def test_topics_that_are_named_are_taken(tmp_path: Path) -> None:
    cameras = found(tmp_path, CAMPUS, "/webcam/image", "/front/image_raw/compressed")
    assert [(one.image, one.info, one.frame) for one in cameras.used] == [
        ("/webcam/image", None, "webcam"),
        ("/front/image_raw/compressed", "/front/camera_info", "front_optical"),
    ]
    assert cameras.left_out == ()


@pytest.mark.parametrize(
    ("content", "images", "words"),
    [
        (CAMPUS, ["/front/image_raw", "/side/image"], "there are no images on /side/image for --image"),
        (CAMPUS, ["/front/image_raw", "/front/camera_info"], "no images on /front/camera_info"),
        (CAMPUS[8:], ["all"], "no camera has a CameraInfo of its own for --image all; /webcam/image is left out"),
        (
            [picture("/a/image", "camera"), picture("/b/image", "/camera")],
            ["/a/image", "/b/image"],
            "/a/image and /b/image are of the frame camera, so nothing tells where each camera is; choose one",
        ),
        ([picture("/a/image", ""), picture("/b/image", "")], ["/a/image", "/b/image"], "are of no frame"),
    ],
)
def test_what_cannot_be_several_cameras_is_refused(
    tmp_path: Path, content: list[Stamped], images: list[str], words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        found(tmp_path, content, *images)


def test_several_camera_infos_are_read_where_boxes_say_whose_they_are(tmp_path: Path) -> None:
    log = write(tmp_path / "log.mcap", CAMPUS)
    with open_recording(log) as recording:
        infos = choose(recording, CAMERA_INFO, Choice())
        assert sorted(info_frames(recording, infos).values()) == ["depth", "front_optical", "rear_optical"]
        (one,) = choose(recording, CAMERA_INFO, Choice({"image": "/front/image_raw"}))
        assert one.topic == "/front/camera_info"
        with pytest.raises(UsageError, match="choose with --image TOPIC, several times or --image all for several"):
            choose(recording, CAMERA_IMAGE, Choice())


def test_two_camera_infos_of_one_frame_must_be_the_same(tmp_path: Path) -> None:
    """A driver may tell a camera's again for depth images that it aligned with it."""
    same = [info("/color/camera_info", "color"), info("/aligned_depth/camera_info", "color")]
    other = [*same, info("/thumbnail/camera_info", "color", 30.0)]
    for content, is_known in ((same, True), (other, False)):
        with open_recording(write(tmp_path / f"{is_known}.mcap", content)) as recording:
            infos = choose(recording, CAMERA_INFO, Choice())
            if is_known:
                assert set(info_frames(recording, infos).values()) == {"color"}
                continue
            with pytest.raises(UsageError, match="both of the frame color, and not the same; choose the images"):
                info_frames(recording, infos)
