"""Training examples: windows of pictures, scaled, mirrored and photographed badly; each step's batch by its number."""

import functools
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.catalog import COCO_ID
from mcap_landmarks_generator.training.pictures import Image, Labels, PictureSet

Floats = NDArray[np.float64]
Rng = np.random.Generator

CLASS_IDS = np.array(sorted(COCO_ID.values()))
"""COCO ids of the classes, in the order of the network's outputs."""

_PADDING = (114, 114, 114, 0)
_SCALE = (0.55, 1.5)
_FOCUSED = 0.75
# Share of examples that are nothing but painted, and of the others whose objects stand before something painted.
_PAINTED, _BEFORE_PAINTED = 0.2, 0.4
_NOISE_MARGIN_PX = 64
# Less than this of an object in the example, or smaller: not to be learned.
_LEAST_SHARE, _LEAST_SIDE_PX = 0.2, 3.0


@dataclass(frozen=True, slots=True)
class Phase:
    """A part of the training: how many steps, over so many examples each, of which size."""

    steps: int
    batch: int
    height_px: int
    width_px: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """From `4000x32x320x320`: steps, batch, height, width."""
        return cls(*(int(number) for number in text.split("x")))

    def __str__(self) -> str:
        return f"{self.steps}x{self.batch}x{self.height_px}x{self.width_px}"


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Images (B, H, W, 3) and targets (N, 6): image, class index, centre x and y, width and height in pixels."""

    images: Image
    targets: NDArray[np.float32]


class Examples:
    """All batches of a training, by step: a batch depends on pictures, seed and step only, so training can resume."""

    def __init__(self, pictures: PictureSet, phases: tuple[Phase, ...], seed: int) -> None:
        self._pictures, self._phases, self._seed = pictures, phases, seed
        self._ends = np.cumsum([phase.steps for phase in phases])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, step: int) -> Batch:
        cv2.setNumThreads(1)
        phase = self._phases[int(np.searchsorted(self._ends, step, side="right"))]
        rng = np.random.default_rng([self._seed, step])
        images = np.empty((phase.batch, phase.height_px, phase.width_px, 3), np.uint8)
        targets = []
        for row in range(phase.batch):
            images[row], rows = self._example(phase, rng)
            targets.append(np.column_stack([np.full(len(rows), row), rows]))
        return Batch(images, np.concatenate(targets).astype(np.float32))

    def _example(self, phase: Phase, rng: Rng) -> tuple[Image, Floats]:
        """An image (H, W, 3), and class index, centre and size (N, 5) of what it shows."""
        pictures = self._pictures
        if pictures.painted and rng.random() < _PAINTED:
            return photographed(self._painted(phase, rng), rng), np.zeros((0, 5))
        index = pictures.rendered[rng.integers(len(pictures.rendered))]
        image, labels = pictures.image(index), pictures.labels[index]
        matrix = _window((image.shape[0], image.shape[1]), labels, phase, rng)
        cut = cv2.warpAffine(image, matrix, (phase.width_px, phase.height_px), borderValue=_PADDING)
        shown = np.asarray(cut[..., :3], np.uint8)
        if pictures.painted and rng.random() < _BEFORE_PAINTED:
            shown = _before(shown, np.asarray(cut[..., 3], np.uint8), self._painted(phase, rng))
        return photographed(shown, rng), _targets(labels, matrix, phase)

    def _painted(self, phase: Phase, rng: Rng) -> Image:
        """A window (H, W, 3) of a painted picture, which goes on beyond its edges as in a mirror."""
        index = self._pictures.painted[rng.integers(len(self._pictures.painted))]
        image = self._pictures.image(index)[..., :3]
        nothing = self._pictures.labels[index]
        matrix = _window((image.shape[0], image.shape[1]), nothing, phase, rng)
        size = (phase.width_px, phase.height_px)
        return np.asarray(cv2.warpAffine(image, matrix, size, borderMode=cv2.BORDER_REFLECT_101), np.uint8)


def _before(image: Image, cover: Image, behind: Image) -> Image:
    """What covers an image (H, W, 3), before something else."""
    share = cover[..., None].astype(np.uint16)
    return np.asarray((image * share + behind * (255 - share) + 127) // 255, np.uint8)


def _window(image_px: tuple[int, int], labels: Labels, phase: Phase, rng: Rng) -> Floats:
    """The map (2, 3) from pixels of a picture to those of an example: a window of random scale, perhaps mirrored."""
    scale = float(np.exp(rng.uniform(*np.log(_SCALE))))
    stretch = scale * float(np.exp(rng.normal(0, 0.05)))
    size = np.array([phase.width_px / stretch, phase.height_px / scale])
    whole = np.array([image_px[1], image_px[0]], float)
    centre = rng.uniform(0, 1, 2) * whole
    if len(labels.classes) and rng.random() < _FOCUSED:
        box = labels.boxes_xyxy[rng.integers(len(labels.classes))]
        centre = (box[:2] + box[2:]) / 2 + rng.uniform(-0.4, 0.4, 2) * size
    inside = np.minimum(np.maximum(centre, size / 2), whole - size / 2)
    centre = np.where(size < whole, inside, whole / 2 + rng.uniform(-0.5, 0.5, 2) * (size - whole))
    across = -stretch if rng.random() < 0.5 else stretch
    return np.array(
        [
            [across, 0, phase.width_px / 2 - across * centre[0]],
            [0, scale, phase.height_px / 2 - scale * centre[1]],
        ]
    )


def _targets(labels: Labels, matrix: Floats, phase: Phase) -> Floats:
    """Class index, centre and size (N, 5) of what an example shows enough of."""
    x = np.sort(labels.boxes_xyxy[:, [0, 2]] * matrix[0, 0] + matrix[0, 2], axis=1)
    y = labels.boxes_xyxy[:, [1, 3]] * matrix[1, 1] + matrix[1, 2]
    left, right = np.clip(x, 0, phase.width_px).T
    top, bottom = np.clip(y, 0, phase.height_px).T
    width, height = right - left, bottom - top
    whole = (x[:, 1] - x[:, 0]) * (y[:, 1] - y[:, 0])
    share = labels.shares * width * height / np.maximum(whole, 1e-9)
    kept = (share >= _LEAST_SHARE) & (np.minimum(width, height) > _LEAST_SIDE_PX)
    index = np.searchsorted(CLASS_IDS, labels.classes)
    rows = np.column_stack([index, (left + right) / 2, (top + bottom) / 2, width, height])
    return np.asarray(rows[kept], float)


def photographed(image: Image, rng: Rng) -> Image:
    """An image with other colours and light, and at times blurred, noisy or compressed."""
    if rng.random() < 0.9:
        image = _recoloured(image, rng)
    if rng.random() < 0.5:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.2, 1.2)), np.uint8)
    if rng.random() < 0.6:
        top, left = rng.integers(0, _NOISE_MARGIN_PX, 2)
        noise = _noise(image.shape[0] + _NOISE_MARGIN_PX, image.shape[1] + _NOISE_MARGIN_PX)
        noise = noise[top : top + image.shape[0], left : left + image.shape[1]]
        image = np.asarray(cv2.scaleAdd(noise, rng.uniform(0.5, 8), image.astype(np.float32)), np.float32)
        image = np.asarray(cv2.convertScaleAbs(np.maximum(image, 0)), np.uint8)
    if rng.random() < 0.5:
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(40, 96))])
        image = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
    return image


@functools.cache
def _noise(height_px: int, width_px: int) -> NDArray[np.float32]:
    """A field of standard normal noise; every image takes its own from another place of it."""
    return np.random.default_rng(0).standard_normal((height_px, width_px, 3), dtype=np.float32)


def _recoloured(image: Image, rng: Rng) -> Image:
    """Hue, saturation and brightness by random factors, and at times more contrast or less."""
    hue, saturation, value = 1 + rng.uniform(-1, 1, 3) * (0.03, 0.6, 0.4)
    power = float(np.exp(rng.normal(0, 0.3))) if rng.random() < 0.5 else 1.0
    level = np.arange(256, dtype=np.float32)
    bright = 255 * np.clip(level / 255 * value, 0, 1) ** power
    tables = [(level * hue) % 180, np.clip(level * saturation, 0, 255), bright]
    planes = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
    changed = [cv2.LUT(plane, table.astype(np.uint8)) for plane, table in zip(planes, tables, strict=True)]
    return np.asarray(cv2.cvtColor(cv2.merge(changed), cv2.COLOR_HSV2RGB), np.uint8)
