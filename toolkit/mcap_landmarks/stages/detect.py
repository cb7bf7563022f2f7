"""Detect objects in camera images with a YOLOv5 ONNX model."""

import dataclasses
import difflib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mcap_landmarks.channels import ANNOTATIONS, CAMERA_IMAGE, DETECTIONS, annotations_topic
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.resources import detector
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped
from mcap_landmarks.vision.annotations import annotations
from mcap_landmarks.vision.classifier import Classifier, open_classifier
from mcap_landmarks.vision.contract import Contract, read_contract
from mcap_landmarks.vision.decode import candidates
from mcap_landmarks.vision.letterbox import Letterbox, fit, fitted_input, tensor
from mcap_landmarks.vision.nms import suppress
from mcap_landmarks.vision.pixels import Rgb, rgb_from_message
from mcap_landmarks.vision.prefetch import in_order
from mcap_landmarks.vision.review import Verdict, review
from mcap_landmarks.vision.session import Session, open_session

_USUAL_CONFIDENCE = 0.25
_THESIS_SIZE_PX = 640

Share = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DetectConfig:
    """How objects are detected.

    `confidence`: scores must be above it; unset, the model's own threshold, or 0.25. `class_confidence` overrules it by
    class name. Boxes of one class that overlap by more than `iou` are one, and an image has at most `max_detections`.
    `classes`: the only ones that are kept, all if empty. Where the model leaves its input free, an image's longer side
    becomes `size_px`, and `shape` says whether the input is as small as the image allows or a square. `anchors` count
    for models of raw heads whose metadata have none. `provider` runs the network, on the CPU in so many `threads`
    (0: one per core), each with an image of its own. A second-stage classifier, where one is given, can veto or relabel
    (`classifier_action`) a box for whose label it has another with a probability of `classifier_confidence`; it sees
    colours of 0 to 1 less `classifier_mean`, divided by `classifier_std`. The thesis (Algorithm 1) has a square of 640,
    a threshold of 0.25, no class filter, and a classifier whose objection is always a veto.
    """

    method: Literal["default", "thesis"] = "default"
    confidence: Share | None = None
    class_confidence: dict[str, Share] = field(default_factory=dict)
    iou: Share = 0.45
    max_detections: Annotated[int, Field(ge=1)] = 300
    classes: tuple[str, ...] = ()
    size_px: Annotated[int, Field(ge=32, le=8192)] = 640
    shape: Literal["fitted", "square"] = "fitted"
    anchors: Literal["yolov5", "yolov7"] = "yolov5"
    provider: Literal["cpu", "cuda"] = "cpu"
    threads: Annotated[int, Field(ge=0)] = 0
    classifier_action: Literal["veto", "relabel"] = "veto"
    classifier_confidence: Share = 0.5
    classifier_mean: Colour = (0.485, 0.456, 0.406)
    classifier_std: Colour = (0.229, 0.224, 0.225)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """N boxes in pixels of the original image: boxes_xyxy (N, 4), scores (N,), class_ids (N,), best first."""

    boxes_xyxy: NDArray[np.float64]
    scores: NDArray[np.float32]
    class_ids: NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """An image on its way through the network."""

    rgb: Rgb
    letterbox: Letterbox
    array: NDArray[np.floating]


def decode(
    outputs: Sequence[NDArray[Any]],
    letterbox: Letterbox,
    input_px: tuple[int, int],
    contract: Contract,
    above: NDArray[np.float32],
    config: DetectConfig,
) -> Found:
    """What the network found in one image, of its outputs for an input (height, width); `above` are the `thresholds`.

    Raises:
        ModelError: the outputs are none of a YOLOv5 detector.
    """
    found = candidates(outputs, contract, input_px, above)
    found = found.take(suppress(found.boxes_xyxy, found.scores, found.class_ids, config.iou, config.max_detections))
    boxes = letterbox.in_image(found.boxes_xyxy)
    seen = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)  # a box in the margins is nothing
    return Found(boxes[seen], found.scores[seen], found.class_ids[seen])


def thresholds(contract: Contract, config: DetectConfig) -> NDArray[np.float32]:
    """The threshold of every class (classes,), infinite for those that are not asked for.

    Raises:
        UsageError: the configuration names a class that the model does not know.
    """
    for name in (*config.classes, *config.class_confidence):
        if name not in contract.names:
            near = difflib.get_close_matches(name, contract.names, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it knows {', '.join(contract.names)}"
            raise UsageError(f"{contract.path} detects no {name}; {hint}")
    own = contract.confidence if config.confidence is None else {}
    usual = _USUAL_CONFIDENCE if config.confidence is None else config.confidence
    by_class = {**dict.fromkeys(contract.names, usual), **own, **config.class_confidence}
    wanted = config.classes or contract.names
    return np.array([by_class[name] if name in wanted else np.inf for name in contract.names], dtype=np.float32)


def process(
    bundles: Iterable[Bundle], config: DetectConfig, resources: Mapping[str, Path]
) -> Iterator[Stamped | Omission]:
    """Detections and annotations of every image; an image that cannot be read is an omission.

    Raises:
        ModelError: a model is not what it should be.
        RecordingError: not one of the images could be read.
    """
    if config.method == "thesis":
        config = _as_in_the_thesis(config)
    # Each image on a thread of its own: nothing waits for the slowest part of a layer, and none runs idle.
    session = open_session(resources["model"], config.provider, threads=1)
    contract = read_contract(session, resources.get("names"), config.anchors)
    if config.method == "thesis" and not {*contract.input_px} <= {None, _THESIS_SIZE_PX}:
        raise UsageError(f"{contract.path}: the thesis's method has an input of 640 x 640; export the model with that")
    above = thresholds(contract, config)
    classifier = _classifier(resources.get("classifier"), contract, config)
    read = failed = 0
    error: MessageError | None = None
    prepare, run = partial(_prepare, contract=contract, config=config), partial(_run, session=session)
    for bundle, result in in_order(bundles, prepare, run, _at_once(config)):
        read += 1
        if isinstance(result, MessageError):
            failed, error = failed + 1, error or result
            yield Omission(bundle.log_time_ns, str(result), lost=True)
            continue
        picture, outputs = result
        found = decode(outputs, picture.letterbox, _input_of(picture), contract, above, config)
        yield from _messages(bundle, found, _verdicts(found, picture, contract, classifier, config))
    if error is not None and failed == read:
        raise RecordingError(f"none of {read} images could be read: {error}")


def _at_once(config: DetectConfig) -> int:
    """How many images the network looks at in parallel."""
    return (config.threads or os.cpu_count() or 1) if config.provider == "cpu" else 1


def _as_in_the_thesis(config: DetectConfig) -> DetectConfig:
    return dataclasses.replace(
        config,
        confidence=_USUAL_CONFIDENCE,
        class_confidence={},
        classes=(),
        size_px=_THESIS_SIZE_PX,
        shape="square",
        classifier_action="veto",
        classifier_confidence=0.0,
    )


def _classifier(path: Path | None, contract: Contract, config: DetectConfig) -> Classifier | None:
    if path is None:
        return None
    colours = config.classifier_mean, config.classifier_std
    return open_classifier(path, contract.names, colours, config.provider, config.threads)


def input_size(contract: Contract, image_px: tuple[int, int], config: DetectConfig) -> tuple[int, int]:
    """The input (height, width) for an image (height, width): the model's, and as configured where that is free."""
    sides = image_px if config.shape == "fitted" else (1, 1)
    height, width = fitted_input(sides, config.size_px, contract.stride_px)
    return contract.input_px[0] or height, contract.input_px[1] or width


def _prepare(bundle: Bundle, contract: Contract, config: DetectConfig) -> _Picture | MessageError:
    message = bundle.messages[CAMERA_IMAGE]
    assert isinstance(message, Image | CompressedImage)  # noqa: S101 - the runner reads no other types as images
    try:
        rgb = rgb_from_message(message)
    except MessageError as error:
        return error
    height, width = rgb.shape[:2]
    input_px = input_size(contract, (height, width), config)
    letterbox = fit((height, width), input_px)
    return _Picture(rgb, letterbox, tensor(rgb, letterbox, input_px, contract.dtype))


def _run(picture: _Picture | MessageError, session: Session) -> tuple[_Picture, list[NDArray[Any]]] | MessageError:
    return picture if isinstance(picture, MessageError) else (picture, session.run(picture.array))


def _input_of(picture: _Picture) -> tuple[int, int]:
    height, width = picture.array.shape[2:]
    return height, width


def _verdicts(
    found: Found, picture: _Picture, contract: Contract, classifier: Classifier | None, config: DetectConfig
) -> list[Verdict]:
    labels = [
        (contract.names[i], score) for i, score in zip(found.class_ids.tolist(), found.scores.tolist(), strict=True)
    ]
    if classifier is None:
        return [Verdict((label,)) for label in labels]
    action, sure = config.classifier_action, config.classifier_confidence
    return review(classifier, picture.rgb, found.boxes_xyxy, labels, action, sure)


def _messages(bundle: Bundle, found: Found, verdicts: Sequence[Verdict]) -> Iterator[Stamped | Omission]:
    image = bundle.messages[CAMERA_IMAGE]
    assert isinstance(image, Image | CompressedImage)  # noqa: S101 - as above
    kept = [(i, verdict.hypotheses) for i, verdict in enumerate(verdicts) if verdict.hypotheses is not None]
    boxes = found.boxes_xyxy[[i for i, _ in kept]].reshape(-1, 4)
    options = tuple(hypotheses for _, hypotheses in kept)
    detections = Detections(image.stamp_ns, image.frame_id, ("",) * len(kept), options, boxes)
    yield Stamped(DETECTIONS, bundle.log_time_ns, detections)
    yield Stamped(ANNOTATIONS, bundle.log_time_ns, annotations(detections))
    for verdict in verdicts:
        if verdict.hypotheses is None:
            yield Omission(bundle.log_time_ns, verdict.reason)


STAGE = Stage(
    "detect",
    reads=(CAMERA_IMAGE,),
    writes=(DETECTIONS, ANNOTATIONS),
    config=DetectConfig,
    process=process,
    thinned=True,
    places={ANNOTATIONS: annotations_topic},
    resources=("model",),
    options=("names", "classifier"),
    bundled={"model": detector},
    tolerance={"box_xyxy_px": 0.5, "score": 1e-4, "others.score": 1e-4, "points.points": 0.5, "texts.position": 0.5},
)
