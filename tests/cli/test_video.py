"""The verb video: what it writes can be decoded, runs in real time and shows what the log has."""

import json
import sys
from pathlib import Path

import av
import jsonschema
import numpy as np
import pytest
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE
from numpy.typing import NDArray

from tests.cli.calls import call, refused, schema_of
from tests.diff.recordings import localized_log
from tests.golden.test_golden import GOLDEN, START_NS
from tests.runs.chain import raw_log

SMALL = ("--size", "320x180", "--fps", "4")


def pictures(path: Path) -> list[NDArray[np.uint8]]:
    """The pictures of a video, which says at what times they are."""
    with av.open(path) as container:
        frames = list(container.decode(video=0))
        assert container.streams.video[0].average_rate == 4
        assert [round(frame.time * 4) for frame in frames if frame.time is not None] == [*range(len(frames))]
        return [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in frames]


def orange(picture: NDArray[np.uint8]) -> int:
    """How many pixels have more red than blue, as estimates have; a video has the colours of thin lines paler."""
    return int((picture[..., 0].astype(int) - picture[..., 2] > 60).sum())


def test_a_video_shows_image_map_and_path(whole_result: Path, tmp_path: Path) -> None:
    out, again = tmp_path / "v.mp4", tmp_path / "again.mp4"
    part = (*SMALL, "--end", str(START_NS + 5 * 10**9))
    assert call("video", whole_result, "-o", out, *part) == DONE
    found = pictures(out)
    assert len(found) == 21
    assert {picture.shape for picture in found} == {(180, 320, 3)}
    first, last = found[0], found[-1]
    image = last[5:115, :160]
    assert image.std() > 20  # a picture of the world
    assert np.abs(image.astype(int) - first[5:115, :160]).mean() > 3  # which is another five seconds later
    assert (last[170:, 180:] > 250).mean() > 0.5  # beside it the map, on white
    assert orange(last[20:160, 180:]) > orange(first[20:160, 180:]) + 20  # with the path so far
    assert (last[125:140, 8:60].astype(int) - [4, 120, 87]).__abs__().sum(axis=2).min() < 40  # localized, in green
    assert call("video", whole_result, "-o", again, *part) == DONE
    assert again.read_bytes() == out.read_bytes()


@pytest.mark.parametrize("log", ["results", "raw", "plain"])
def test_what_a_log_lacks_is_left_out(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Results without images, images and scans without results, poses without a scan."""
    path = {
        "results": lambda: GOLDEN / "localize.mcap",
        "raw": lambda: raw_log(tmp_path / "log.mcap"),
        "plain": lambda: localized_log(tmp_path / "log.mcap"),
    }[log]()
    assert call("video", path, "-o", tmp_path / "v.mp4", *SMALL, "--json") == DONE
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("video"))
    assert document["pictures"] == len(pictures(tmp_path / "v.mp4"))
    assert ("/landmarks/pose" in document["topics"]) is (log != "raw")
    assert ("/scan" in document["topics"]) is (log == "raw")


def test_trouble_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "log.mcap"), tmp_path / "v.mp4"
    for words, told in (
        (("-o", tmp_path / "v.avi"), "use .mp4"),
        (("-o", out, "--size", "321x180"), "two even numbers"),
        (("-o", out, "--size", "big"), "two even numbers"),
        (("-o", out, "--fps", "0"), "--fps 0: give a number above 0"),
        (("-o", out, "--image", "/left"), "there is no topic /left for --image"),
        (("-o", out, "--start", "soon"), "--start soon: give RFC 3339"),
        (("-o", out, "--start", str(START_NS)), "no message lies between --start and --end"),
    ):
        assert told in refused(capsys, 2, "video", log, *words)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "av", None)
        assert "pip install 'mcap-landmarks[video]'" in refused(capsys, UNUSABLE, "video", log, "-o", out, *SMALL)
    assert not out.exists()
    log.write_bytes(log.read_bytes()[:-200])
    assert call("video", log, "-o", out, *SMALL) == PARTIAL
    assert pictures(out)
    assert "exists" in refused(capsys, 2, "video", log, "-o", out)
