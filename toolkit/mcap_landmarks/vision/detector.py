"""A detector: an ONNX file of a known family, with its class names and thresholds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.families import FAMILIES, family_names, find_family
from mcap_landmarks.vision.family import DetectionCandidates, Family, ModelLayout, Signature
from mcap_landmarks.vision.metadata import confidence_of, names_of
from mcap_landmarks.vision.onnx_session import FLOATS, OnnxSession, fits, written

_EXPORT = (
    "export it again (yolo export model=FILE.pt format=onnx; YOLOv5: python export.py --weights FILE.pt --include onnx)"
)


@dataclass(frozen=True, slots=True, eq=False)
class Detector:
    """What a model takes and gives.

    `confidence` holds the model's own thresholds by class name, empty where its metadata have none.
    """

    session: OnnxSession
    family: Family
    layout: ModelLayout
    names: tuple[str, ...]
    confidence: Mapping[str, float]

    @property
    def path(self) -> Location:
        """Where the model is."""
        return self.session.path

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """The type of its input."""
        return FLOATS[self.session.inputs[0].dtype]

    def run(self, array: NDArray[np.floating]) -> list[NDArray[Any]]:
        """The outputs for an input (1, 3, height, width).

        Raises:
            ModelError: the model cannot take this input.
        """
        return self.session.run(array, self.layout.constants)

    def candidates(
        self, outputs: list[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """The boxes in the outputs for an input (height, width), above the threshold of their class (classes,).

        Raises:
            ModelError: the outputs have other shapes than those of the model's family.
        """
        expected = self.layout.outputs(input_px)
        used = outputs[: len(expected)]
        if len(used) != len(expected) or not all(map(fits, (output.shape for output in used), expected)):
            found = ", ".join(written(output.shape) for output in outputs)
            raise ModelError(
                f"{self.path}: for an input {written((1, 3, *input_px))} the outputs are {found}, but a detector of "
                f"{len(self.names)} classes ({self.family.title}) gives {', '.join(map(written, expected))}; export it "
                "again"
            )
        return self.layout.decode(used, input_px, thresholds)


def read_detector(session: OnnxSession, names_file: Location | None, config: DetectConfig) -> Detector:
    """The detector that an ONNX file is, with the class names of its metadata if there is no file of them.

    Raises:
        ModelError: it is of no known family, or its metadata cannot be read.
        UsageError: there is no such family as configured, or the model could be of several.
    """
    names = names_of(session, names_file)
    assumed = {"anchors": config.anchors}
    signature = Signature(session.path, session.inputs, session.outputs, len(names), session.metadata, assumed)
    family, layout = _recognised(signature, _asked_for(config.family, signature))
    return Detector(session, family, layout, names, confidence_of(session, names))


def _asked_for(name: str | None, signature: Signature) -> tuple[str, ...]:
    """The families that count: the one configured, else the one that the metadata name, else all."""
    known = family_names()
    if name is not None and name not in known:
        raise UsageError(f"detect.family = {name}: there is no such family of detectors; there are {', '.join(known)}")
    only = name or signature.stated
    return (only,) if only in known else FAMILIES.usable()


def _recognised(signature: Signature, names: tuple[str, ...]) -> tuple[Family, ModelLayout]:
    found, expected = [], []
    for family in map(find_family if len(names) == 1 else FAMILIES.own, names):
        layout = family.recognise(signature)
        if isinstance(layout, ModelLayout):
            found.append((family, layout))
        else:
            expected.append(f"{layout} ({family.title})")
    if not found:
        if signature.image_px() is None:
            expected = [f"an input {written((1, 3, None, None))} {' or '.join(FLOATS)}"]
        raise ModelError(
            f"{signature.path}: not a detector of {signature.classes} classes: found input "
            f"{', '.join(map(str, signature.inputs))} and output {', '.join(map(str, signature.outputs))}; expected "
            f"{'; '.join(expected)}; {_EXPORT}, or give the right --names FILE"
        )
    if len(found) > 1:
        could_be = " or ".join(f"{family.name} ({family.title})" for family, _ in found)
        raise UsageError(f"{signature.path} could be of the family {could_be}; choose with --set detect.family=NAME")
    return found[0]
