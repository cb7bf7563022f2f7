"""Detect objects in camera images with an ONNX model."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any

from numpy.typing import NDArray

from mcap_landmarks.channels import ANNOTATIONS, CAMERA_IMAGE, DETECTIONS, annotations_topic
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.networks.choice import choose_network
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped
from mcap_landmarks.vision.annotations import annotations
from mcap_landmarks.vision.batching import groups_of, images_at_once, run_together
from mcap_landmarks.vision.classifier import Classifier, open_classifier
from mcap_landmarks.vision.config import THESIS_SIZE_PX, DetectConfig
from mcap_landmarks.vision.detection import Found, Prepared, find, prepare, thresholds
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.families import FAMILIES
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks.vision.pixels import Rgb, rgb_from_message
from mcap_landmarks.vision.prefetch import AHEAD, in_order
from mcap_landmarks.vision.providers import settled
from mcap_landmarks.vision.review import Verdict, review

_Image = tuple[Rgb, tuple[Prepared, ...]]
"""An image and its parts on their way through the network."""
_Looked = tuple[Rgb, tuple[Prepared, ...], list[list[NDArray[Any]]]] | MessageError
"""An image, its parts and the network's outputs for each; or why it cannot be read."""


def process(
    bundles: Iterable[Bundle], config: DetectConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """Detections and annotations of every image; an image that cannot be read is an omission.

    Raises:
        ModelError: a model is not what it should be.
    """
    if config.method == "thesis":
        config = config.as_in_the_thesis()
    # Each image on a thread of its own: nothing waits for the slowest part of a layer, and none runs idle.
    session = open_session(resources["model"], config.provider, threads=1)
    detector = read_detector(session, resources.get("names"), config)
    if config.method == "thesis" and not {*detector.layout.input_px} <= {None, THESIS_SIZE_PX}:
        raise UsageError(f"{detector.path}: the thesis's method has an input of 640 x 640; export the model with that")
    above = thresholds(detector, config)
    classifier = _classifier(resources.get("classifier"), detector, config)
    for bundle, result in _through(bundles, detector, config):
        if isinstance(result, MessageError):
            frame_id = getattr(bundle.messages[CAMERA_IMAGE], "frame_id", "")
            yield Omission(bundle.log_time_ns, str(result), lost=True, frame_id=frame_id)
            continue
        rgb, prepared, outputs = result
        found = find(outputs, prepared, detector, above, config)
        yield from _messages(bundle, found, _verdicts(found, rgb, detector, classifier, config))


def on_one_thread(config: DetectConfig) -> DetectConfig:
    """The configuration for one of several workers on a machine: images are looked at one after the other."""
    return replace(config, threads=1)


def _through(bundles: Iterable[Bundle], detector: Detector, config: DetectConfig) -> Iterator[tuple[Bundle, _Looked]]:
    """Every image with what the network made of it. On the CPU it looks at one per thread, on a GPU at some at once."""
    together, on_cpu = images_at_once(detector, config.batch), detector.session.provider == "cpu"
    first = partial(_prepared, detector=detector, config=config)
    second = partial(_run, detector=detector, together=together)
    threads = (config.threads or os.cpu_count() or 1) if on_cpu else 1
    preparing = 1 if on_cpu else AHEAD + 1  # a GPU is faster than a core decodes
    for group, results in in_order(groups_of(bundles, together), first, second, threads, preparing):
        yield from zip(group, results, strict=True)


def _classifier(path: Location | None, detector: Detector, config: DetectConfig) -> Classifier | None:
    if path is None:
        return None
    colours = config.classifier_mean, config.classifier_std
    return open_classifier(path, detector.names, colours, config.provider, config.threads)


def _prepared(group: Sequence[Bundle], detector: Detector, config: DetectConfig) -> list[_Image | MessageError]:
    return [_image(bundle.messages[CAMERA_IMAGE], detector, config) for bundle in group]


def _image(message: Message, detector: Detector, config: DetectConfig) -> _Image | MessageError:
    assert isinstance(message, Image | CompressedImage)  # noqa: S101 - the runner reads no other types as images
    try:
        rgb = rgb_from_message(message)
    except MessageError as error:
        return error
    return rgb, prepare(rgb, detector, config)


def _run(group: Sequence[_Image | MessageError], detector: Detector, together: int) -> list[_Looked]:
    arrays = [part.array for image in group if not isinstance(image, MessageError) for part in image[1]]
    outputs = iter(run_together(detector, arrays, together))
    return [
        image if isinstance(image, MessageError) else (*image, list(islice(outputs, len(image[1])))) for image in group
    ]


def _verdicts(
    found: Found, rgb: Rgb, detector: Detector, classifier: Classifier | None, config: DetectConfig
) -> list[Verdict]:
    labels = [
        (detector.names[i], score) for i, score in zip(found.class_ids.tolist(), found.scores.tolist(), strict=True)
    ]
    if classifier is None:
        return [Verdict((label,)) for label in labels]
    action, sure = config.classifier_action, config.classifier_confidence
    return review(classifier, rgb, found.boxes_xyxy, labels, action, sure)


def _messages(bundle: Bundle, found: Found, verdicts: Sequence[Verdict]) -> Iterator[Stamped | Omission]:
    image = bundle.messages[CAMERA_IMAGE]
    assert isinstance(image, Image | CompressedImage)  # noqa: S101 - as above
    kept = [(i, verdict.hypotheses) for i, verdict in enumerate(verdicts) if verdict.hypotheses is not None]
    boxes = found.boxes_xyxy[[i for i, _ in kept]].reshape(-1, 4)
    options = tuple(hypotheses for _, hypotheses in kept)
    detections = Detections(image.stamp_ns, image.frame_id, ("",) * len(kept), options, boxes)
    yield Stamped(DETECTIONS, bundle.log_time_ns, detections)
    yield Stamped(ANNOTATIONS, bundle.log_time_ns, annotations(detections), image.frame_id)
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
    in_segments=on_one_thread,
    places={ANNOTATIONS: annotations_topic},
    resources=("model",),
    options=("names", "classifier"),
    choices={"model": choose_network},
    settle=settled,
    tolerance={"box_xyxy_px": 0.5, "score": 1e-4, "others.score": 1e-4, "points.points": 0.5, "texts.position": 0.5},
    extensible=(FAMILIES,),
)
