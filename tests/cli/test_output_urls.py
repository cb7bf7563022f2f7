"""Every verb writes to a store what it writes to a folder, byte for byte, and replaces it there as it does here."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest
from mcap_landmarks.resources import resource

from tests.cli.calls import call, refused
from tests.cli.logs import messages, write
from tests.diff.recordings import localized_log
from tests.remote.object_store import Bucket
from tests.runs.chain import raw_log, two_posts

LINES = {
    "batch": "batch convert {raw} {raw2} --workers 1 -o OUT/batch/",
    "cluster": "cluster {raw} -o OUT/a.mcap",
    "convert": "convert {raw} -o OUT/a.mcap",
    "convert to a bag": "convert {raw} --to rosbag2 -o OUT/bag/",
    "convert to a bag of ROS 1": "convert {raw} --to bag -o OUT/a.bag",
    "convert in parts": "convert {raw} --split-count 20 -o OUT/parts/",
    "detect": "detect {raw} {raw2} --model {model} -o OUT/several/",
    "diff": "diff {before} {before} --junit OUT/a.xml --markdown OUT/a.md",
    "diff, blessing": "diff {before} --bless --baseline OUT/blessed/",
    "evaluate": "evaluate {result} --tum OUT/a.tum --thesis OUT/a.txt",
    "export": "export {result} --format tum -o OUT/a.tum",
    "export with images": "export {detected} --format coco -o OUT/a.json --images OUT/images/",
    "foxglove": "foxglove {result} -o OUT/layout.json",
    "fuse": "fuse {detected} -o OUT/a.mcap",
    "landmarks export": "landmarks export {map} OUT/a.json",
    "landmarks import": "landmarks import OUT/a.db {csv}",
    "localize": "localize {scenes} --map {map} -o OUT/a.mcap",
    "map": "map {scenes} --map OUT/a.db -o OUT/a.mcap",
    "models check": "models check {model} -o OUT/a.png",
    "plot": "plot {result} -o OUT/a.svg",
    "recover": "recover {raw} -o OUT/a.mcap",
    "report": "report {result} -o OUT/a.html",
    "run": "run {scenes} --stages localize --map {map} -o OUT/a.mcap",
    "video": "video {result} --size 320x180 --fps 4 -o OUT/a.mp4",
}
"""Every verb that writes what the user names, each once: the demo calls others, teleop ends with its driver.

Left out are two that take seconds and write as others do: explain's picture as plot's, generate's log as cluster's.
"""
AGAIN = {
    **dict.fromkeys(("convert to a bag", "convert in parts", "detect", "diff, blessing", "localize", "plot"), True),
    **dict.fromkeys(("export", "export with images", "foxglove"), True),
    **dict.fromkeys(("diff", "evaluate", "landmarks import"), False),
}
"""Whether what some of them write tells what it was made of or stays as it is, and so needs no --overwrite."""


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """What the verbs read."""
    folder = tmp_path_factory.mktemp("given")
    files = {
        "raw": raw_log(folder / "raw.mcap"),
        "raw2": raw_log(folder / "raw2.mcap", 6),
        "model": two_posts(folder / "model.onnx"),
        "scenes": write(folder / "scenes.mcap", messages(count=40)),
        "result": localized_log(folder / "result.mcap"),
    }
    for name in ("map", "detected"):
        files[name] = folder / f"{name}.{'db' if name == 'map' else 'mcap'}"
    assert call("map", files["scenes"], "--map", files["map"]) == 0
    found = ("--stages", "detect,cluster", "--model", files["model"], "-o", files["detected"])
    assert call("run", files["raw"], *found) == 0
    files |= {"csv": folder / "a.csv", "before": folder / "before"}
    assert call("landmarks", "export", files["map"], files["csv"]) == 0
    files["before"].mkdir()
    shutil.copy(files["result"], files["before"])
    return files


def files_below(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("verb", LINES)
def test_the_same_bytes_here_and_there(
    verb: str, given: Mapping[str, Path], bucket: Bucket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    (tmp_path / "out").mkdir()
    words = LINES[verb].format_map(given)
    assert call(*words.replace("OUT", str(tmp_path / "out")).split()) == 0
    assert call(*words.replace("OUT", bucket.url("out")).split()) == 0
    here = files_below(tmp_path / "out")
    assert here
    assert {name.removeprefix("out/"): bucket.read(name) for name in bucket.names()} == here
    assert files_below(tmp_path / "cache") == {}
    if verb not in AGAIN:
        return
    again = words.replace("OUT", bucket.url("out")).split()
    assert call(*again) == (0 if AGAIN[verb] else 2)
    assert call(*again, *([] if verb == "diff, blessing" else ["--overwrite"])) == 0
    assert {name.removeprefix("out/"): bucket.read(name) for name in bucket.names()} == here


def test_what_is_of_something_else_stays(
    given: Mapping[str, Path], bucket: Bucket, capsys: pytest.CaptureFixture[str]
) -> None:
    raw = str(given["raw"])
    for name, words in (
        ("a.mcap", ("recover", raw, "-o")),
        ("a.html", ("report", str(given["result"]), "-o")),
        ("a.db", ("map", str(given["scenes"]), "--map")),
        ("bag/other.txt", ("convert", raw, "--to", "rosbag2", "-o")),
    ):
        url = bucket.write(name, b"mine")
        target = bucket.url("bag/") if name.startswith("bag") else url
        line = refused(capsys, 2, *words, target)
        assert "exists and is no earlier result" in line or "which is of no bag" in line
        assert bucket.read(name) == b"mine"
    url = bucket.write("log.mcap", given["raw"].read_bytes())
    assert "is the input itself" in refused(capsys, 2, "recover", url, "-o", url)
    assert "two outputs would be this file" in refused(
        capsys, 2, "map", given["scenes"], "--map", bucket.url("x"), "-o", bucket.url("x")
    )


def test_an_interrupted_run_goes_on_from_finished_stages(
    given: Mapping[str, Path],
    bucket: Bucket,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    words = ("detect", given["raw"], "--model", given["model"], "-o", bucket.url("a.mcap"))
    with monkeypatch.context() as patch:

        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        patch.setattr("mcap_landmarks.remote.staged_outputs.send_file", stop)
        assert call(*words) == 130
    assert bucket.names() == []
    assert call(*words) == 0
    assert "detect reused: the same results are in what an unfinished run left" in capsys.readouterr().err
    assert bucket.names() == ["a.mcap"]
    assert files_below(tmp_path / "cache") == {}


def test_a_web_server_is_no_place_to_write(capsys: pytest.CaptureFixture[str]) -> None:
    url = "https://host.example/a.mcap?signature=secret"
    line = refused(capsys, 2, "recover", resource("recordings", "demo_map.mcap"), "-o", url)
    assert line == (
        "error: https://host.example/a.mcap?...: nothing can be written to a web server; write to s3://, gs:// or "
        "az://, or to a file"
    )
