"""Several images in one call: the outputs of each are those that it has alone."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.batching import images_at_once, run_together, takes_several
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.onnx_session import open_session
from numpy.typing import NDArray

from tests.vision.networks import Export, answering, yolov5


def detector(folder: Path, batch: int | str = "images") -> Detector:
    path = folder / "m.onnx"
    yolov5(path, ["a", "b"], export=Export("h", "w", form="heads", batch=batch))
    return read_detector(open_session(path, threads=1), None, DetectConfig())


def images() -> list[NDArray[np.floating]]:
    """Five inputs of two sizes."""
    rng = np.random.default_rng(0)
    return [rng.random((1, 3, 64, width), dtype=np.float32) for width in (64, 96, 64, 64, 96)]


@pytest.mark.parametrize("at_once", [1, 2, 8])
def test_outputs_are_those_of_each_image_alone(tmp_path: Path, at_once: int) -> None:
    network = detector(tmp_path)
    arrays = images()
    for array, outputs in zip(arrays, run_together(network, arrays, at_once), strict=True):
        alone = network.run(array)
        assert [output.shape for output in outputs] == [output.shape for output in alone]
        for one, other in zip(outputs, alone, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-4)


def test_what_is_found_does_not_depend_on_the_number_of_images(tmp_path: Path) -> None:
    network = detector(tmp_path)
    first = images()[:1]
    for one, other in zip(run_together(network, first, 4)[0], run_together(network, first * 3, 4)[2], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_a_batch_is_for_gpus_and_for_networks_that_take_one(tmp_path: Path) -> None:
    network = detector(tmp_path)
    assert takes_several(network)
    assert images_at_once(network, 8) == 1  # on a CPU
    network.session.provider = "cuda"
    assert images_at_once(network, 8) == 8
    fixed = detector(tmp_path, batch=1)
    fixed.session.provider = "cuda"
    assert images_at_once(fixed, 8) == 1


def test_rows_that_name_their_image_are_no_batch(tmp_path: Path) -> None:
    """YOLOv7 `--end2end` gives the boxes of all images in one table."""
    rows = {"output": np.zeros((3, 7), np.float32)}
    path = answering(tmp_path / "m.onnx", rows, {"names": "['a', 'b']"}, ("n", 3, 64, 64))
    network = read_detector(open_session(path, threads=1), None, DetectConfig())
    assert network.family.name == "nms_in_graph"
    assert not takes_several(network)


def test_a_batch_axis_that_is_free_by_name_only_is_said(tmp_path: Path) -> None:
    rows = {"output0": np.zeros((1, 252, 7), np.float32)}
    path = answering(tmp_path / "m.onnx", rows, {"names": "['a', 'b']"}, ("n", 3, 64, 64))
    network = read_detector(open_session(path, threads=1), None, DetectConfig())
    with pytest.raises(ModelError, match=r"for 4 images its outputs have other lengths.*detect\.batch=1"):
        run_together(network, [np.zeros((1, 3, 64, 64), np.float32)], 4)
