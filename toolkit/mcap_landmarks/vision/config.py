"""How objects are detected: the configuration of the detect stage."""

import dataclasses
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

THESIS_SIZE_PX = 640
"""Side of the square that the thesis's detector takes (Algorithm 1)."""
USUAL_CONFIDENCE = 0.25
"""The threshold of YOLOv5's own `detect.py`, and of the thesis (Algorithm 1)."""

Provider = Literal["cpu", "cuda", "tensorrt"]
"""What can run a network."""
ProviderChoice = Literal[Provider, "auto"]
Share = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DetectConfig:
    """How objects are detected.

    `confidence`: scores must be above it; unset, the model's own threshold, or 0.25. `class_confidence` overrules it by
    class name. Boxes of one class that overlap by more than `iou` are one, and an image has at most `max_detections`.
    `classes`: the only ones that are kept, all if empty. Where the model leaves its input free, an image's longer side
    becomes `size_px`, and `shape` says whether the input is as small as the image allows or a square. With `tiles`
    above 1 so many parts along the image's longer side, which overlap, are looked at beside the whole, with "auto" as
    many as an image needs that would be shrunk much (`vision.tiles`): small objects are found, for more time. `family`
    is the kind of detector that the model is of, unset: the one whose outputs it has. `anchors` count for models of raw
    heads whose metadata have none. `provider` runs the network, "auto" is CUDA where that starts and else the CPU; on
    the CPU in so many `threads` (0: one per core), each with an image of its own, on a GPU `batch` images in one call
    where the model's batch axis is free. A second-stage classifier, where one is given, can veto or relabel
    (`classifier_action`) a box for whose label it has another with a probability of `classifier_confidence`; it sees
    colours of 0 to 1 less `classifier_mean`, divided by `classifier_std`. The thesis (Algorithm 1) has a square of 640,
    one tile, a threshold of 0.25, no class filter, and a classifier whose objection is always a veto.
    """

    method: Literal["default", "thesis"] = "default"
    confidence: Share | None = None
    class_confidence: dict[str, Share] = field(default_factory=dict)
    iou: Share = 0.45
    max_detections: Annotated[int, Field(ge=1)] = 300
    classes: tuple[str, ...] = ()
    size_px: Annotated[int, Field(ge=32, le=8192)] = 640
    shape: Literal["fitted", "square"] = "fitted"
    tiles: Annotated[int, Field(ge=1, le=16)] | Literal["auto"] = 1
    family: str | None = None
    anchors: Literal["yolov5", "yolov7"] = "yolov5"
    provider: ProviderChoice = "cpu"
    threads: Annotated[int, Field(ge=0)] = 0
    batch: Annotated[int, Field(ge=1, le=256)] = 8
    classifier_action: Literal["veto", "relabel"] = "veto"
    classifier_confidence: Share = 0.5
    classifier_mean: Colour = (0.485, 0.456, 0.406)
    classifier_std: Colour = (0.229, 0.224, 0.225)

    def as_in_the_thesis(self) -> "DetectConfig":
        """The same with the thesis's values wherever it has no choice (Algorithm 1)."""
        return dataclasses.replace(
            self,
            confidence=USUAL_CONFIDENCE,
            class_confidence={},
            classes=(),
            size_px=THESIS_SIZE_PX,
            shape="square",
            tiles=1,
            classifier_action="veto",
            classifier_confidence=0.0,
        )
