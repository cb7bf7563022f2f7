"""What is there stays: inputs always, everything else that is no earlier result unless the user says so."""

from pathlib import Path

import pytest
from mcap.writer import Writer as McapWriter
from mcap_landmarks.errors import UsageError
from mcap_landmarks.manifest import RUN, Manifest
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.replacing import (
    check_apart,
    check_replaceable,
    earlier_map,
    earlier_picture,
    earlier_recording,
    generated_recording,
    output_to,
    picture_mark,
)

from tests.maps.examples import small_map


def recorded(path: Path, manifest: Manifest) -> Path:
    with create_recording(path, {RUN: manifest.entries()}):
        pass
    return path


def test_no_output_is_an_input_by_whatever_name(tmp_path: Path) -> None:
    source, folder = tmp_path / "in", tmp_path / "bag"
    source.write_bytes(b"input")
    (folder / "below").mkdir(parents=True)
    (folder / "below" / "part").write_bytes(b"part")
    (tmp_path / "soft").symlink_to(source)
    (tmp_path / "hard").hardlink_to(source)
    (tmp_path / "hard_part").hardlink_to(folder / "below" / "part")
    for name in ("in", "soft", "hard"):
        with pytest.raises(UsageError, match=rf"{name} is the input .*itself; write to another file"):
            check_apart([tmp_path / name], [tmp_path / "none", source])
    for name in ("bag/below/part", "hard_part"):
        with pytest.raises(UsageError, match=rf"{name} is part of the input .*bag; write to another file"):
            check_apart([tmp_path / name], [folder])
    check_apart([folder / "new", tmp_path / "new"], [folder, source])
    with (
        pytest.raises(UsageError, match="is the input itself"),
        output_to(source, [source], lambda _: True, overwrite=True),
    ):
        pass
    assert source.read_bytes() == b"input"


def test_two_outputs_are_two_files(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "new")
    with pytest.raises(UsageError, match="link: two outputs would be this file"):
        check_apart([tmp_path / "new", tmp_path / "link"], [])


def test_recordings_of_the_same_verb_and_inputs_are_replaced(tmp_path: Path) -> None:
    there = recorded(tmp_path / "out.mcap", Manifest("map", inputs=("a", "b"), fingerprint="a"))
    check_replaceable(there, earlier_recording("map", ["b", "a"]), overwrite=False)
    for other in (earlier_recording("localize", ["a", "b"]), earlier_recording("map", ["a"]), earlier_map("map", [])):
        with pytest.raises(UsageError, match=r"out\.mcap exists and is no earlier result .* with --overwrite"):
            check_replaceable(there, other, overwrite=False)
        check_replaceable(there, other, overwrite=True)
    for content in (b"", b"no recording", there.read_bytes()[:40]):
        there.write_bytes(content)
        assert not earlier_recording("map", ["a", "b"])(there)


def test_a_result_that_somebody_edited_stays(tmp_path: Path) -> None:
    there, manifest = tmp_path / "out.mcap", Manifest("localize", inputs=("a",), fingerprint="a")
    entries = {**manifest.entries(), "content": '"of other chunks"'}
    with there.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        writer.add_metadata(RUN, entries)
        writer.finish()
    assert not earlier_recording("localize", ["a"])(there)
    assert earlier_recording("localize", ["a"])(recorded(there, manifest))


def test_a_world_is_generated_again_in_its_place(tmp_path: Path) -> None:
    manifest = Manifest("generate", config={"scenario": {"laps": 1}}, seed=7)
    there = recorded(tmp_path / "log.mcap", manifest)
    assert generated_recording(manifest.entries())(there)
    for other in (Manifest("generate", config={"scenario": {"laps": 2}}, seed=7), Manifest("generate", seed=7)):
        assert not generated_recording(other.entries())(there)


def test_a_map_of_the_same_logs_is_replaced(tmp_path: Path) -> None:
    there = tmp_path / "map.db"
    write_map(there, small_map(), Manifest("map", inputs=("a", "b")).entries())
    assert earlier_map("map", ["b", "a"])(there)
    assert not earlier_map("map", ["a"])(there)
    assert not earlier_map("map --from-reference", ["a", "b"])(there)
    write_map(there, small_map())  # as an import
    assert not earlier_map("map", [])(there)


def test_a_picture_tells_what_it_shows(tmp_path: Path) -> None:
    log = recorded(tmp_path / "log.mcap", Manifest("localize", inputs=("a",), fingerprint="a"))
    picture = tmp_path / "picture.svg"
    picture.write_text(f"<svg><!-- {picture_mark('plot', [log])} --></svg>")
    assert earlier_picture("plot", [log])(picture)
    assert not earlier_picture("explain", [log])(picture)
    assert not earlier_picture("plot", [log, log])(picture)
