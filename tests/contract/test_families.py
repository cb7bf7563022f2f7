"""What every detector family keeps: found by name, recognised by its own models alone, careful with what they say."""

import importlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.families import family_names, find_family
from mcap_landmarks.vision.family import ModelLayout, Signature
from mcap_landmarks.vision.onnx_session import Tensor, open_session
from numpy.typing import DTypeLike, NDArray

from tests.vision.networks import NO_METADATA, Export, answering, yolov5

CLASSES = ["person", "car"]
INPUT_PX = (64, 96)


def written(folder: Path, export: Export) -> Path:
    yolov5(folder / "m.onnx", CLASSES, export=export)
    return folder / "m.onnx"


def constant_answer(
    outputs: Sequence[NDArray[np.floating]], names: Sequence[str] = (), metadata: Mapping[str, str] = NO_METADATA
) -> Callable[[Path], Path]:
    """A network of these outputs, whatever it sees."""
    named = dict(zip(names or [f"output{i}" for i in range(len(outputs))], outputs, strict=True))
    every = {"names": str(CLASSES), **metadata}
    return lambda folder: answering(folder / "m.onnx", named, every, (1, 3, *INPUT_PX))


def shares(*shapes: tuple[int, ...], dtype: DTypeLike = np.float32) -> list[NDArray[np.floating]]:
    """Random outputs of such shapes."""
    return [np.random.default_rng(i).random(shape).astype(dtype) for i, shape in enumerate(shapes)]


def with_classes(shape: tuple[int, ...], column: int) -> list[NDArray[np.floating]]:
    """The same with whole numbers of classes in a column."""
    (output,) = shares(shape)
    output[..., column] = np.arange(output[..., column].size) % len(CLASSES)
    return [output]


SAMPLES: dict[str, list[Callable[[Path], Path]]] = {
    "detr": [
        constant_answer(shares((1, 300, 6)), metadata={"description": "Ultralytics rtdetr-l model"}),
        constant_answer(shares((1, 300, 4), (1, 300, 2), dtype=np.float16), ("pred_boxes", "logits")),
        constant_answer(shares((1, 300, 4), (1, 300, 2)), ("dets", "labels")),
    ],
    "nms_in_graph": [
        constant_answer(with_classes((1, 300, 6), 5), metadata={"description": "YOLO26n", "end2end": "True"}),
        constant_answer(with_classes((100, 7), 5)),
        constant_answer(
            [np.full((1, 1), 50.0, np.float32), *shares((1, 99, 4), (1, 99)), np.arange(99.0, dtype="f4")[None] % 2],
            ("num_dets", "boxes", "scores", "classes"),
        ),
    ],
    "nanodet": [
        constant_answer(shares((1, 96 + 24 + 6, 2 + 4 * 11))),
        constant_answer(shares((1, 96 + 24 + 6 + 2, 2 + 4 * 8), dtype=np.float16)),
        constant_answer(shares(*((1, cells, columns) for columns in (2, 44) for cells in (96, 24, 6)))),
    ],
    "yolov8": [
        constant_answer(shares((1, 4 + 2, 96 + 24 + 6))),
        constant_answer(shares((1, 4 + 2, 96 + 24 + 6), dtype=np.float16)),
    ],
    "yolox": [constant_answer(shares((1, 96 + 24 + 6, 5 + 2)))],
    "yolov5": [
        lambda folder: written(folder, Export(*INPUT_PX)),
        lambda folder: written(folder, Export("h", "w")),
        lambda folder: written(folder, Export(*INPUT_PX, form="heads")),
        lambda folder: written(folder, Export(*INPUT_PX, form="planes")),
        lambda folder: written(folder, Export(*INPUT_PX, half=True)),
    ],
}
"""Models of two classes that take an input of 64 x 96, of every layout that a family knows."""
EACH = [pytest.param(name, make, id=f"{name}-{i}") for name in family_names() for i, make in enumerate(SAMPLES[name])]
NOTHING = np.full(2, np.inf, np.float32)
EVERYTHING = np.zeros(2, np.float32)


def opened(path: Path) -> Detector:
    return read_detector(open_session(path, threads=1), None, DetectConfig())


def signature(inputs: tuple[Tensor, ...], outputs: tuple[Tensor, ...]) -> Signature:
    return Signature(Path("model.onnx"), inputs, outputs, len(CLASSES))


@pytest.mark.parametrize("name", family_names())
def test_the_declaration_is_whole(name: str) -> None:
    family = find_family(name)
    module = importlib.import_module(f"mcap_landmarks.vision.families.{name}")
    assert family.name == name
    assert family.title
    assert family.recognise is module.recognise
    assert inspect.getdoc(module)


@pytest.mark.parametrize("name", family_names())
def test_other_networks_are_refused_in_one_line(name: str) -> None:
    image, output = Tensor("images", (1, 3, 64, 64), "float"), Tensor("output", (1, 1000), "float")
    for strange in (
        signature((image,), (output,)),
        signature((image,), ()),
        signature((), (output,)),
        signature((Tensor("text", (1, 77), "int64"),), (output,)),
        signature((image, Tensor("scale", (1, 2), "float")), (output, output)),
    ):
        words = find_family(name).recognise(strange)
        assert isinstance(words, str)
        assert words
        assert "\n" not in words


@pytest.mark.parametrize(("name", "make"), EACH)
class TestModel:
    def test_it_is_recognised_by_its_family_alone(
        self, name: str, make: Callable[[Path], Path], tmp_path: Path
    ) -> None:
        detector = opened(make(tmp_path))
        assert detector.family is find_family(name)
        session, two = detector.session, len(CLASSES)
        found = Signature(session.path, session.inputs, session.outputs, two, session.metadata)
        counted = family_names() if found.stated is None else (found.stated,)
        layouts = {other: find_family(other).recognise(found) for other in counted}
        assert [other for other, layout in layouts.items() if isinstance(layout, ModelLayout)] == [name]

    def test_its_outputs_have_the_shapes_of_its_layout(
        self, name: str, make: Callable[[Path], Path], tmp_path: Path
    ) -> None:
        del name
        detector = opened(make(tmp_path))
        outputs = detector.run(np.zeros((1, 3, *INPUT_PX), detector.dtype))
        expected = detector.layout.outputs(INPUT_PX)
        assert [output.shape for output in outputs[: len(expected)]] == list(expected)

    def test_candidates_are_above_their_thresholds(
        self, name: str, make: Callable[[Path], Path], tmp_path: Path
    ) -> None:
        del name
        detector = opened(make(tmp_path))
        image = np.random.default_rng(0).random((1, 3, *INPUT_PX)).astype(detector.dtype)
        outputs = detector.run(image)
        whole = detector.candidates(outputs, INPUT_PX, EVERYTHING)
        count = len(whole.scores)
        assert (whole.boxes_xyxy.shape, whole.class_ids.shape) == ((count, 4), (count,))
        assert set(whole.class_ids.tolist()) == {0, 1}
        assert len(detector.candidates(outputs, INPUT_PX, NOTHING).scores) == 0
        above = np.array([np.inf, np.median(whole.scores)], np.float32)
        some = detector.candidates(outputs, INPUT_PX, above)
        good = (whole.class_ids == 1) & (whole.scores > above[1])
        assert 0 < good.sum() < count
        np.testing.assert_array_equal(some.boxes_xyxy, whole.boxes_xyxy[good])
        np.testing.assert_array_equal(some.scores, whole.scores[good])

    def test_numbers_that_are_not_finite_are_no_candidates(
        self, name: str, make: Callable[[Path], Path], tmp_path: Path
    ) -> None:
        del name
        detector = opened(make(tmp_path))
        outputs = detector.run(np.zeros((1, 3, *INPUT_PX), detector.dtype))
        for value in (np.nan, np.inf, -np.inf):
            broken = [np.full_like(output, value) for output in outputs]
            with np.errstate(invalid="ignore", over="ignore"):
                found = detector.candidates(broken, INPUT_PX, EVERYTHING)
            assert np.isfinite(found.boxes_xyxy).all()
            assert np.isfinite(found.scores).all()
