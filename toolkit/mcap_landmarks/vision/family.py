"""The shape of a detector family: how its models are recognised, what they take, and how their outputs become boxes."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.locations import Location
from mcap_landmarks.vision.letterbox import Boxes, Colours, Letterbox, fit
from mcap_landmarks.vision.metadata import literal, stated_family
from mcap_landmarks.vision.onnx_session import FLOATS, Shape, Tensor, fits

ImageSides = tuple[int | None, int | None]
"""Height and width in pixels, None where free."""


def takes_images(entry: Tensor) -> bool:
    """Whether an input takes one colour image of any size."""
    return fits(entry.shape, (1, 3, None, None)) and entry.dtype in FLOATS


@dataclass(frozen=True, slots=True, eq=False)
class DetectionCandidates:
    """N boxes in pixels of the input: boxes_xyxy (N, 4), scores (N,), class_ids (N,)."""

    boxes_xyxy: Boxes
    scores: NDArray[np.float32]
    class_ids: NDArray[np.intp]

    def take(self, indices: NDArray[Any]) -> "DetectionCandidates":
        """Some of the boxes."""
        return DetectionCandidates(self.boxes_xyxy[indices], self.scores[indices], self.class_ids[indices])


@dataclass(frozen=True, slots=True)
class Signature:
    """What an ONNX file says of itself: its inputs, outputs and metadata, and the number of classes of its names.

    `assumed` holds values that count where the metadata have none.
    """

    path: Location
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    classes: int
    metadata: Mapping[str, str] = field(default_factory=dict)
    assumed: Mapping[str, object] = field(default_factory=dict)

    def value(self, key: str) -> object:
        """What the metadata say, else what is assumed, else None.

        Raises:
            ModelError: the metadata's entry cannot be read.
        """
        own = literal(self.path, self.metadata, key)
        return self.assumed.get(key) if own is None else own

    @property
    def stated(self) -> str | None:
        """The family that the metadata name, None if they name none."""
        return stated_family(self.metadata)

    def image_px(self, stride_px: int = 1) -> ImageSides | None:
        """The (height, width) of the images that the first input takes, None where free; None if it takes none.

        A side that is not in whole `stride_px` is none.
        """
        if not self.inputs or not takes_images(self.inputs[0]):
            return None
        height, width = self.inputs[0].shape[2:]
        return (height, width) if not any(side and side % stride_px for side in (height, width)) else None


@dataclass(frozen=True, slots=True, eq=False)
class ModelLayout(ABC):
    """The inputs and outputs of one model of a family.

    `input_px` is (height, width), None where free; a free side is chosen in whole `stride_px`. The image is the first
    input; every other one is a constant by name. `colours` says how it is normalised, and `place` puts an image
    (height, width) into an input (height, width). `by_image`: of several images, the first axis of every output tells
    which one.
    """

    input_px: ImageSides
    stride_px: int
    constants: Mapping[str, NDArray[Any]] = field(default_factory=dict, kw_only=True)
    colours: Colours = field(default_factory=Colours, kw_only=True)
    place: Callable[[tuple[int, int], tuple[int, int]], Letterbox] = field(default=fit, kw_only=True)
    by_image: bool = field(default=True, kw_only=True)

    @abstractmethod
    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """The shapes of the first outputs for an input (height, width), None where a length is free."""

    @abstractmethod
    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """The boxes whose score is above the threshold of their class (classes,), of outputs of the said shapes.

        Boxes and scores that are not finite are left out.
        """


@dataclass(frozen=True, slots=True)
class Family:
    """Detectors of one kind of output.

    `title` names them in messages. `recognise` gives the layout of a model of the family; for any other it says, in the
    words of an error, what the family expects in place of what is there. `needs_nms`: several boxes of one object are
    to be expected.
    """

    name: str
    title: str
    recognise: Callable[[Signature], ModelLayout | str]
    needs_nms: bool
