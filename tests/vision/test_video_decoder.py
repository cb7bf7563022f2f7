"""Videos become the pictures that they were made of, in their order; what cannot be decoded is said in its place."""

import sys
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.messages.video import TheoraPacket, codec_of
from mcap_landmarks.vision.pixels import Rgb
from mcap_landmarks.vision.video_decoder import VideoDecoder
from rosbags.highlevel import AnyReader

COUNT, KEY = 20, 8
SIZE = 120, 160


def pictures() -> list[Rgb]:
    """A block of one colour that moves over ever brighter green."""
    found = []
    for i in range(COUNT):
        one = np.zeros((*SIZE, 3), np.uint8)
        one[:, :, 1] = 60 + i * 8
        one[20:60, i * 4 : i * 4 + 40] = 200, 40, 60
        found.append(one)
    return found


def packets(codec: str = "libx264", **options: str) -> list[bytes]:
    """The packets of the pictures, with a key frame every 8."""
    encoder = av.CodecContext.create(codec, "w")
    assert isinstance(encoder, av.VideoCodecContext)
    encoder.width, encoder.height, encoder.pix_fmt = SIZE[1], SIZE[0], "yuv420p"
    encoder.time_base, encoder.framerate = Fraction(1, 10), Fraction(10)
    encoder.options = {"crf": "5", "g": str(KEY), **(options or {"tune": "zerolatency"})}
    found = []
    for i, one in enumerate(pictures()):
        frame = av.VideoFrame.from_ndarray(one, format="rgb24")
        frame.pts = i
        found += [bytes(packet) for packet in encoder.encode(frame)]
    return found + [bytes(packet) for packet in encoder.encode(None)]


def decoded(form: str, data: list[bytes]) -> list[Rgb | MessageError]:
    decoder = VideoDecoder(form)
    found = [picture for packet in data for picture in decoder.take(packet)]
    return [*found, *decoder.finish()]


def is_of(found: Rgb | MessageError, wanted: Rgb) -> bool:
    """Alike within what is lost with chroma at half the size, away from edges."""
    assert isinstance(found, np.ndarray)
    off = np.abs(found.astype(int) - wanted).max(axis=2)
    return bool(np.quantile(off, 0.9) <= 6)


def test_each_packet_gives_its_picture() -> None:
    for form, codec, options in (
        ("h264", "libx264", {}),
        ("h265", "libx265", {"x265-params": f"keyint={KEY}:bframes=0:log-level=none"}),
    ):
        found = decoded(form, packets(codec, **options))
        assert len(found) == COUNT
        assert all(is_of(one, wanted) for one, wanted in zip(found, pictures(), strict=True))


def test_the_same_packets_give_the_same_pictures() -> None:
    first, second = (decoded("h264", packets()) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_packets_in_the_order_of_decoding_keep_their_places() -> None:
    """With pictures that build on later ones, packets come before their time: I0 P4 B2 B1 B3 or the like."""
    found = decoded("h264", packets(bf="2", g=str(KEY)))
    assert len(found) == COUNT
    numbers = [
        min(range(COUNT), key=lambda i, one=one: np.abs(one.astype(int) - pictures()[i]).sum())
        for one in found
        if isinstance(one, np.ndarray)
    ]
    assert sorted(numbers) == list(range(COUNT))
    assert numbers != list(range(COUNT))


def test_nothing_comes_before_the_first_key_frame() -> None:
    found = decoded("h264", packets()[3:])
    assert [isinstance(one, MessageError) for one in found] == [True] * (KEY - 3) + [False] * (COUNT - KEY)
    assert "key frame" in str(found[0])
    assert is_of(found[KEY - 3], pictures()[KEY])


def test_a_packet_of_rubbish_costs_no_others_their_places() -> None:
    data = packets()
    data[KEY + 2 : KEY + 4] = [b"rubbish", b""]
    found = decoded("h264", data)
    assert len(found) == COUNT
    assert "cannot be decoded" in str(found[KEY + 2])
    assert "empty" in str(found[KEY + 3])
    assert is_of(found[KEY - 1], pictures()[KEY - 1])
    assert is_of(found[2 * KEY], pictures()[2 * KEY])


def test_real_theora(shared_data: Path) -> None:
    """122 pictures after three headers; without the ninth packet, those until the next key frame are not whole."""
    with AnyReader([shared_data / "landmarks" / "neato" / "wall_follow.bag"]) as reader:
        topic = [one for one in reader.connections if one.topic == "/camera/image_raw/theora"]
        raw = [reader.deserialize(data, one.msgtype) for one, _, data in reader.messages(topic)]
    every = [TheoraPacket(0, "camera", int(one.packetno), one.data.tobytes()) for one in raw]
    assert [one.is_header for one in every] == [True] * 3 + [False] * 122

    def run(some: list[TheoraPacket]) -> list[Rgb | MessageError]:
        decoder = VideoDecoder("theora")
        return [*(picture for one in some for picture in decoder.take_theora(one)), *decoder.finish()]

    found = run(every)
    assert {one.shape for one in found if isinstance(one, np.ndarray)} == {(480, 640, 3)}
    assert len(found) == 122
    gap = run(every[:8] + every[9:])
    next_key = next(i for i, one in enumerate(every[8:], 8) if one.data[0] & 0x40 == 0)
    assert [isinstance(one, MessageError) for one in gap] == [5 <= i < next_key - 4 for i in range(121)]
    assert {str(one) for one in run(every[5:9])} == {"the headers of the video did not come before it"}


def test_pictures_that_are_too_large_are_not_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcap_landmarks.vision.video_decoder._MOST_PIXELS", SIZE[0] * SIZE[1] - 1)
    assert all(isinstance(one, MessageError) for one in decoded("h264", packets()))


def test_without_pyav_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RecordingError, match=r"h264 video .*pip install 'mcap-landmarks\[video\]'"):
        VideoDecoder("h264")


def test_what_counts_as_video() -> None:
    assert [codec_of(form) for form in ("h264", "H265", "hevc; x", "jpeg", "bgr8; jpeg compressed bgr8", "")] == [
        "h264", "hevc", "hevc", None, None, None,
    ]  # fmt: skip
