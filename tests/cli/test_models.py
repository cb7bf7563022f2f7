"""The verb models, and the network that other verbs take."""

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
import pytest
from mcap_landmarks.manifest import RUN
from mcap_landmarks.networks.known import KNOWN
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource

from tests.cli.calls import call, refused, schema_of
from tests.networks.test_npm_package import archive, entry
from tests.runs.chain import raw_log, two_posts
from tests.vision.networks import answering

DEMO = resource("recordings", "demo_localize.mcap")
ONE_S = ("--end", 1_767_225_601_000_000_000)


def document(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    capsys.readouterr()
    assert call("models", *words, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, schema_of(f"models_{words[0]}"))
    return found


def network_of(path: Path) -> tuple[str, str]:
    """The hash of the network that detected in a recording, and where it came from."""
    with open_recording(path) as recording:
        record = json.loads(recording.metadata[RUN]["stages"])["detect"]
    return record["resources"]["model"], record["origins"]["model"]


def test_networks_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "list")["models"]
    assert [(one["name"], one["state"]) for one in found] == [("bundled", "bundled"), ("nanodet", "not fetched")]
    assert Path(found[0]["path"]).is_file()
    assert call("models", "list") == 0
    assert "nanodet: not fetched; NanoDet-g" in capsys.readouterr().out


def test_a_network_is_only_taken_as_it_is_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = archive(tmp_path / "other.tgz", [(entry(KNOWN["nanodet"].model, 2), b"{}")])
    assert "has the SHA-256" in refused(capsys, 1, "models", "get", "nanodet", "--from", other)
    assert "there are nanodet" in refused(capsys, 2, "models", "get", "yolov9", "--from", other)


def test_without_the_extra_its_name_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("mcap_landmarks.networks.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "onnx", None)
    said = refused(capsys, 1, "models", "get", "nanodet", "--from", "nowhere.tgz")
    assert said == "error: onnx is not installed: pip install 'mcap-landmarks[models]'"


def test_a_network_is_checked_on_an_image_of_the_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "check", "bundled", "-o", tmp_path / "boxes.png")
    assert (found["family"], len(found["classes"]), found["images"]) == (
        "YOLOv5 or YOLOv7",
        80,
        ["the demo's first image"],
    )
    assert {box["class"] for box in found["detections"]} == {"fire hydrant", "person", "suitcase"}
    assert found["runs_on"] == "cpu, one image at a time"
    assert found["speeds"][0]["threads"] == 1
    assert all(speed["ms"] > 0 for speed in found["speeds"])
    drawn = cv2.imread(str(tmp_path / "boxes.png"))
    assert drawn is not None
    assert drawn.shape == (480, 640, 3)


def test_a_network_is_checked_on_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, height in (("a", 48), ("b", 20)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.zeros((height, 64, 3), np.uint8))
    images = ("--image", tmp_path / "a.png", "--image", tmp_path / "b.png")
    words = ("models", "check", two_posts(tmp_path / "model.onnx"), *images, "-o", tmp_path / "out.png")
    assert call(*words) == 0
    said = capsys.readouterr().out
    assert "model.onnx: YOLOv5 or YOLOv7, 0.0 MB" in said
    assert "2 classes: person, fire hydrant" in said
    assert "ms an image (64 x 64) on 1 thread\n" in said
    assert f"{tmp_path / 'a.png'}" in said
    assert cv2.imread(str(tmp_path / "out.png")).shape == (68, 64, 3)


def test_what_is_no_detector_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = answering(tmp_path / "other.onnx", {"output0": np.zeros((1, 9), np.float32)}, {"names": "['a']"})
    assert "other.onnx: not a detector" in refused(capsys, 1, "models", "check", other)
    assert "there is no such" in refused(capsys, 2, "models", "check", "bundled", "--set", "detect.family=x")
    assert "use .png" in refused(capsys, 2, "models", "check", "bundled", "-o", tmp_path / "a.gif")
    assert "models get nanodet" in refused(capsys, 2, "models", "check", "nanodet")


@pytest.mark.slow
def test_an_audition_tells_how_far_an_object_is_recognised(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pybullet")
    words = ("audition", "bundled", "--classes", "suitcase", "-o", tmp_path / "sheet.png")
    (found,) = document(capsys, *words)["objects"]
    assert (found["class"], found["variant"], len(found["views"])) == ("suitcase", "standard", 56)
    near = [view for view in found["views"] if view["distance_m"] == 2]
    assert sum(view["found"] == "suitcase" for view in near) >= 7
    assert min(view["hits"] for view in near) >= 6
    assert cv2.imread(str(tmp_path / "sheet.png")).shape == (24 + 128 + 36, 150 + 7 * 128, 3)
    assert "the generator has no unicorn" in refused(capsys, 1, "models", "audition", "bundled", "--classes", "unicorn")


@pytest.mark.slow
def test_what_the_generator_made_is_detected_with_the_bundled_network_whatever_became_of_it(tmp_path: Path) -> None:
    """The mark survives results, cuts and conversions; other logs lose it where they are merged in."""
    results, again, converted = (tmp_path / f"{name}.mcap" for name in ("results", "again", "converted"))
    assert call("detect", DEMO, "-o", results, *ONE_S) == 0
    assert call("convert", results, "-o", converted) == 0
    assert call("detect", converted, "-o", again, "--force") == 0
    assert network_of(results) == network_of(again)
    assert network_of(again)[1] == "bundled"
    merged = tmp_path / "merged.mcap"
    assert call("convert", converted, raw_log(tmp_path / "own.mcap"), "-o", merged) == 0
    assert call("detect", merged, "-o", tmp_path / "no.mcap", "--image", "/camera/image_raw/compressed") == 2


def test_a_log_of_others_needs_a_real_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, model, out = raw_log(tmp_path / "log.mcap"), two_posts(tmp_path / "model.onnx"), tmp_path / "out.mcap"
    for verb, words in (
        ("detect", ("-o", out)),
        ("run", ("--stages", "detect", "-o", out)),
        ("map", ("--map", tmp_path / "map.db")),
    ):
        assert "models get nanodet" in refused(capsys, 2, verb, log, *words)
    assert call("detect", log, "-o", out, "--model", model) == 0
    given = network_of(out)
    assert given[1] == "file"
    config = tmp_path / "config.toml"
    config.write_text(f'[detect]\nmodel = "{model}"\n')
    capsys.readouterr()
    assert call("detect", log, "-o", out, "--config", config) == 0
    assert "detect reused" in capsys.readouterr().err  # the same file is the same network
    assert call("detect", log, "-o", out, "--set", "detect.model=bundled") == 0
    assert "detect ran: the file model changed" in capsys.readouterr().err
    assert network_of(out)[1] == "bundled"
    assert network_of(out)[0] != given[0]


def test_the_network_in_the_cache_is_taken_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    models = tmp_path / "cache" / "models"
    models.mkdir(parents=True)
    two_posts(models / "nanodet.onnx")
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(models.parent))
    log, out = raw_log(tmp_path / "log.mcap"), tmp_path / "out.mcap"
    assert call("detect", log, "-o", out) == 0
    assert network_of(out)[1] == "nanodet"
    assert call("detect", DEMO, "-o", tmp_path / "demo.mcap", "--model", "nanodet", *ONE_S) == 0
    assert network_of(tmp_path / "demo.mcap") == network_of(out)
