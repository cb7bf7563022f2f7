"""ONNX files: what is opened once, what cannot be run, and what is said of it."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.onnx_session import open_session

from tests.vision.networks import answering

NAMES = {"names": "['person', 'car']"}


def rows() -> np.ndarray:
    return np.zeros((1, 252, 7), np.float32)


def test_files_that_are_no_networks(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="No such file"):
        open_session(tmp_path / "missing.onnx")
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(ModelError, match=r"text\.onnx: not an ONNX model"):
        open_session(tmp_path / "text.onnx")


def test_an_input_that_a_network_cannot_take(tmp_path: Path) -> None:
    session = open_session(answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES))
    with pytest.raises(ModelError, match=r"failed on an input \[1, 3, 32, 32\]"):
        session.run(np.zeros((1, 3, 32, 32), np.float32))


def test_one_session_for_one_file(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES)
    assert open_session(path, threads=1) is open_session(path, threads=1)
    assert open_session(path, threads=1) is not open_session(path, threads=2)
