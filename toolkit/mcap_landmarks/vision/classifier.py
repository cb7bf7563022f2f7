"""A second-stage image classifier: what an ONNX file must be, and what it says about parts of an image."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError
from mcap_landmarks.locations import Location
from mcap_landmarks.vision.config import ProviderChoice
from mcap_landmarks.vision.metadata import names_of
from mcap_landmarks.vision.onnx_session import FLOATS, OnnxSession, fits, open_session
from mcap_landmarks.vision.pixels import Rgb

_USUAL_SIDE_PX = 224
_WIDER, _MARGIN_PX = 1.3, 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Classifier:
    """A classifier: class names, input (height, width), and the mean and spread that it takes colours by."""

    session: OnnxSession
    names: tuple[str, ...]
    input_px: tuple[int, int]
    mean: tuple[float, float, float]
    std: tuple[float, float, float]

    def probabilities(self, image: Rgb, boxes_xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability of every class for every box (N, classes) of an image."""
        found = np.empty((len(boxes_xyxy), len(self.names)))
        for i, box in enumerate(boxes_xyxy):
            part = cv2.resize(_part(image, box), self.input_px[::-1], interpolation=cv2.INTER_LINEAR)
            colours = (part / np.float32(255) - np.array(self.mean, np.float32)) / np.array(self.std, np.float32)
            array = np.ascontiguousarray(colours.transpose(2, 0, 1)[None], FLOATS[self.session.inputs[0].dtype])
            output = self.session.run(array)[0]
            if output.shape != (1, len(self.names)):
                raise ModelError(
                    f"{self.session.path}: found an output of shape {list(output.shape)}, expected "
                    f"[1, {len(self.names)}]; export the classifier again"
                )
            found[i] = _as_probabilities(output[0].astype(np.float64))
        return found


def open_classifier(
    path: Location,
    fallback_names: tuple[str, ...],
    colours: tuple[tuple[float, float, float], tuple[float, float, float]],
    provider: ProviderChoice,
    threads: int,
) -> Classifier:
    """A classifier whose names are its metadata's, else `fallback_names` if it has as many classes.

    Raises:
        ModelError: it is no classifier of images.
    """
    session = open_session(path, provider, threads)
    inputs, outputs = session.inputs, session.outputs
    usable = len(inputs) == len(outputs) == 1 and fits(inputs[0].shape, (1, 3, None, None))
    if not usable or inputs[0].dtype not in FLOATS or not fits(outputs[0].shape, (1, None)):
        raise ModelError(
            f"{path}: not an image classifier: found input {', '.join(map(str, inputs))} and output "
            f"{', '.join(map(str, outputs))}; expected input [1, 3, ?, ?] float or float16 and output [1, ?]"
        )
    names = names_of(session, None) if "names" in session.metadata else fallback_names
    if not fits(outputs[0].shape, (1, len(names))):
        raise ModelError(
            f"{path}: its output {outputs[0]} does not fit {len(names)} class names; put its names into its metadata"
        )
    height, width = inputs[0].shape[2] or _USUAL_SIDE_PX, inputs[0].shape[3] or _USUAL_SIDE_PX
    return Classifier(session, names, (height, width), *colours)


def _part(image: Rgb, box_xyxy: NDArray[np.float64]) -> Rgb:
    """The square around a box, a third wider and 30 px more as in YOLOv5's second stage, as far as the image goes."""
    height, width = image.shape[:2]
    centre_u, centre_v = (box_xyxy[:2] + box_xyxy[2:]) / 2
    half = (max(box_xyxy[2:] - box_xyxy[:2]) * _WIDER + _MARGIN_PX) / 2
    left, right = max(0, int(centre_u - half)), min(width, int(np.ceil(centre_u + half)))
    top, bottom = max(0, int(centre_v - half)), min(height, int(np.ceil(centre_v + half)))
    return image[top:bottom, left:right]


def _as_probabilities(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values themselves if they are a distribution already, else their softmax."""
    if (values >= 0).all() and abs(values.sum() - 1) < 1e-3:
        return values
    grown = np.exp(values - values.max())
    return np.asarray(grown / grown.sum())
