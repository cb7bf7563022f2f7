"""Videos in a log are read as images: all packets are decoded, whichever are looked at, and the losses are told."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.video import CompressedVideo
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.thinning import Thinning
from mcap_landmarks.stage import Channel, RawMessage
from mcap_landmarks.stages.detect import STAGE

from tests.vision.test_video_decoder import COUNT, KEY, is_of, packets, pictures

STEP_NS = 10**8
EVERYTHING, UNTHINNED = Span(), Thinning()
Kind = type[CompressedVideo] | type[CompressedImage]


def write(path: Path, kind: Kind = CompressedVideo, *, jpeg: bool = False, data: list[bytes] | None = None) -> Path:
    """A video of 10 images a second on /camera/video, and beside it pictures on /camera/jpeg."""
    with create_recording(path) as writer:
        video = writer.connection(Channel("/camera/video", kind))
        other = writer.connection(Channel("/camera/jpeg", CompressedImage))
        for i, packet in enumerate(data or packets()):
            time_ns = (i + 1) * STEP_NS
            writer.write(RawMessage(video, time_ns, time_ns, i, encode(kind(time_ns, "camera", "h264", packet))))
            if jpeg:
                message = CompressedImage(time_ns, "camera", "jpeg", b"\xff\xd8")
                writer.write(RawMessage(other, time_ns, time_ns, i, encode(message)))
    return path


@contextmanager
def stage_input(path: Path, span: Span = EVERYTHING) -> Iterator[StageInput]:
    with open_recording(path) as recording:
        yield StageInput(STAGE, RecordedLog(recording, span).without_results(), span)


def images(log: StageInput, thinning: Thinning = UNTHINNED) -> dict[int, Image]:
    """By number, the images that detect gets."""
    found = {}
    for bundle in log.bundles(lambda _count: None, thinning):
        message = bundle.messages[CAMERA_IMAGE]
        assert isinstance(message, Image)
        assert (message.stamp_ns, message.frame_id, message.encoding) == (bundle.stamp_ns, "camera", "rgb8")
        found[bundle.log_time_ns // STEP_NS - 1] = message
    log.close()
    return found


def rgb(image: Image) -> np.ndarray:
    return np.frombuffer(image.data, np.uint8).reshape(image.height_px, image.width_px, 3)


@pytest.mark.parametrize("kind", [CompressedVideo, CompressedImage])
def test_a_video_is_read_as_images(kind: Kind, tmp_path: Path) -> None:
    with stage_input(write(tmp_path / "log.mcap", kind)) as log:
        assert log.count == COUNT
        found = images(log)
        assert log.reading.losses == []
    assert sorted(found) == list(range(COUNT))
    assert all(is_of(rgb(found[i]), wanted) for i, wanted in enumerate(pictures()))


def test_images_that_are_left_out_were_decoded(tmp_path: Path) -> None:
    with stage_input(write(tmp_path / "log.mcap")) as log:
        found = images(log, Thinning(rate_hz=2.0))
    assert sorted(found) == [0, 3, 8, 13, 18]  # every 0.5 s of the clock; key frames are 0, 8 and 16
    assert all(is_of(rgb(image), pictures()[i]) for i, image in found.items())


def test_reading_from_the_middle_begins_with_a_key_frame(tmp_path: Path) -> None:
    with stage_input(write(tmp_path / "log.mcap"), Span(start_ns=4 * STEP_NS)) as log:
        found = images(log)
        (loss,) = log.reading.losses
    assert sorted(found) == list(range(KEY, COUNT))
    assert loss.startswith(f"/camera/video: {KEY - 3} messages")
    assert "key frame" in loss


def test_a_damaged_packet_is_told(tmp_path: Path) -> None:
    data = [*packets()[:-1], b"rubbish"]
    with stage_input(write(tmp_path / "log.mcap", data=data)) as log:
        assert sorted(images(log)) == list(range(COUNT - 1))
        assert "1 message of its video" in log.reading.losses[0]


def test_other_images_come_first_unless_a_video_is_chosen(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", jpeg=True)
    with stage_input(path) as log:
        assert log.primary.topic == "/camera/jpeg"
    with stage_input(path, Span(Choice({"image": "/camera/video"}))) as log:
        assert log.primary.topic == "/camera/video"
        assert len(images(log)) == COUNT


def test_without_pyav_the_log_and_the_remedy_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    path = write(tmp_path / "log.mcap", data=[b"packet"])
    with pytest.raises(RecordingError, match=r"log.mcap: h264 video .*pip install 'mcap-landmarks\[video\]'"), \
            stage_input(path) as log:  # fmt: skip
        images(log)
