"""Settings, extrinsics, metadata and manifests that are deep, huge or nonsense: one line in words, in no time."""

import json
import time
from pathlib import Path

import pytest
from mcap.writer import Writer
from mcap_landmarks import config, manifest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.mounting import read_extrinsics
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.sources._bag_metadata import described

from tests.cli.calls import call

DEEP = "[" * 100_000
LONG = "1" + "0" * 5000


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("deep.json", f'{{"transforms": {DEEP}}}'),
        ("deep.toml", f"transforms = {DEEP}"),
        ("long.json", f'{{"transforms": [{LONG}]}}'),
        ("long.toml", f"transforms = [{LONG}]"),
        ("huge.json", f'{{"transforms": [{{"parent": "a", "child": "b", "xyz": [{LONG[:400]}, 0, 0]}}]}}'),
    ],
)
def test_extrinsics_that_cannot_be_are_refused(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError, match=rf"{name}: (extrinsics cannot be read|transform 1: xyz)"):
        read_extrinsics(tmp_path / name)


@pytest.mark.parametrize("value", [DEEP, LONG])
def test_settings_that_cannot_be_are_refused(value: str, tmp_path: Path) -> None:
    (tmp_path / "given.toml").write_text(f"[localize]\nmax_sigma_m = {value}\n")
    with pytest.raises(UsageError, match="not a TOML file"):
        config.gather(tmp_path / "given.toml", [], None)


def test_a_setting_that_is_no_toml_is_a_text() -> None:
    with pytest.raises(UsageError, match="max_sigma_m"):
        config.gather(None, [f"localize.max_sigma_m={DEEP}"], None)


@pytest.mark.parametrize(
    "text", [DEEP, "{" * 5000, "a: &a [*a]\n", "- " * 5000, "x" * (5 << 20), "a:\n" + "  b: 1\n" * 3 + "c: [*none]"]
)
def test_metadata_of_bags_is_read_in_no_time(text: str) -> None:
    start = time.perf_counter()
    found = described(f"rosbag2_bagfile_information: {text}")
    assert found is None or not found.files
    assert time.perf_counter() - start < 5


@pytest.mark.parametrize("entry", ["{", "[1, 2", "7", "[]", '{"a": []}', DEEP])
def test_a_manifest_that_is_none_is_ignored(entry: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "by hand")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/talk", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0\1\0\0\0\0", 1)
        entries = dict.fromkeys(("losses", "carried", "stages", "config", "fingerprint", "content"), entry)
        writer.add_metadata(manifest.RUN, entries)
        writer.finish()
    with open_recording(path) as recording:
        assert len(recording.fingerprint()) == 64
    assert call("info", "--check", path) in {0, 3}
    assert call("convert", path, "-o", tmp_path / "out.mcap") in {0, 3}
    assert call("diff", path, tmp_path / "out.mcap") in {0, 1, 3}


def test_a_damaged_entry_counts_for_nothing() -> None:
    assert manifest.told_losses({manifest.RUN: {"losses": json.dumps({"a": 1})}}) == []
    assert manifest.told_carried({manifest.RUN: {"carried": '{"/a": 3, "/b": "x"}'}}) == {"/a": 3}
