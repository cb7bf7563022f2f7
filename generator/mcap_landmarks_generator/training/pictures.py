"""The set of pictures: rendered, labelled from the segmentation mask, and kept in shards that map into memory."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.catalog import COCO_ID
from mcap_landmarks_generator.camera import Intrinsics
from mcap_landmarks_generator.optics import Optics
from mcap_landmarks_generator.renderer import Rendered, Renderer
from mcap_landmarks_generator.training import clutter
from mcap_landmarks_generator.training.worlds import Recipe, Scene, scene
from mcap_landmarks_generator.visibility import true_detections

Image = NDArray[np.uint8]

SHARD_SCENES = 16
PAINTED = "painted"
"""What the names of shards of painted pictures begin with."""
_INDEX = "set.json"
_PER_SCENE = 8
_NOTHING = (np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """The M objects of a picture: COCO ids (M,), boxes (M, 4) in pixels, visible shares (M,), distances (M,)."""

    classes: NDArray[np.int64]
    boxes_xyxy: NDArray[np.float64]
    shares: NDArray[np.float64]
    distances_m: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image (H, W, 3) in RGB with its labels, and the bearings (M,) of the objects' centres, left is positive.

    `cover` (H, W) tells by 0 to 255 how much of each pixel objects cover; the rest is ground and sky.
    """

    image: Image
    cover: Image
    labels: Labels
    bearings_rad: NDArray[np.float64]


def render(one: Scene, exposed: bool) -> Iterator[Picture]:
    """The pictures of a scene; `exposed` ones went through lens, sensor and JPEG, the others are as rendered."""
    spec = one.scenario.camera
    optics = Optics(spec, Intrinsics.of(spec).focal_px, one.scenario.seed)
    places = {placed.object_id: placed.route_xy[0] for placed in one.objects}
    renderer = Renderer(one.scenario, one.objects)
    for index, view in enumerate(one.views):
        rendered = renderer.draw(view)
        truth = true_detections(rendered, renderer, view, 0)
        away = np.array([places[name] - view.eye_m[:2] for name in truth.ids]).reshape(-1, 2)
        labels = Labels(
            np.array([COCO_ID[options[0][0]] for options in truth.hypotheses], np.int64),
            truth.boxes_xyxy,
            np.array([options[0][1] for options in truth.hypotheses]),
            np.hypot(away[:, 0], away[:, 1]),
        )
        image = rendered.image
        ahead = away @ view.world_from_optical[:2, [0, 2]]
        bearings_rad = np.arctan2(-ahead[:, 0], ahead[:, 1])
        if exposed:
            image = optics.developed(optics.expose(image, index, 0.0))
        yield Picture(image, _cover(rendered), labels, bearings_rad)


def painted(seed: int, index: int) -> Picture:
    """A painted picture of nothing that is looked for; none of it is covered."""
    image = clutter.paint(seed, index)
    return Picture(image, np.zeros(image.shape[:2], np.uint8), Labels(*_NOTHING), np.zeros(0))


def _cover(rendered: Rendered) -> Image:
    cover = np.zeros(rendered.image.shape[:2], np.uint8)
    window = rendered.window
    if window is not None:
        mask = np.where(rendered.body_ids >= 0, np.uint8(255), np.uint8(0))
        finer = cv2.resize(mask, (window.width, window.height), interpolation=cv2.INTER_AREA)
        cover[window.top : window.bottom, window.left : window.right] = finer
    return cover


def make(
    folder: Path, recipes: Sequence[tuple[Recipe, int]], seed: int, workers: int = 1, painted_scenes: int = 0
) -> Iterator[int]:
    """Render so many scenes of each recipe into a folder, shard by shard; yields how many scenes are there.

    `painted_scenes` come beside them, each of as many painted pictures of nothing as a scene has views. Shards that are
    there already are kept: an interrupted call goes on where it was.
    """
    folder.mkdir(parents=True, exist_ok=True)
    kinds: list[tuple[str, Recipe | None, int]] = [
        (str(kind), recipe, scenes) for kind, (recipe, scenes) in enumerate(recipes)
    ]
    kinds.append((PAINTED, None, painted_scenes))
    jobs = [
        (
            folder / f"{kind}{first // SHARD_SCENES:03d}.npz",
            recipe,
            seed,
            range(first, min(first + SHARD_SCENES, scenes)),
        )
        for kind, recipe, scenes in kinds
        for first in range(0, scenes, SHARD_SCENES)
    ]
    done = sum(len(job[3]) for job in jobs if job[0].exists())
    yield done
    with get_context("spawn").Pool(workers) as pool:
        for rendered in pool.imap_unordered(_make_shard, [job for job in jobs if not job[0].exists()]):
            done += rendered
            yield done
    about = {
        "seed": seed,
        "scenes": [scenes for _, _, scenes in kinds],
        "sha256": _digest(sorted(folder.glob("*.np[yz]"))),
    }
    (folder / _INDEX).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _make_shard(job: tuple[Path, Recipe | None, int, range]) -> int:
    target, recipe, seed, indices = job
    if recipe is None:
        numbers = range(indices.start * _PER_SCENE, indices.stop * _PER_SCENE)
        _save(target, [painted(seed, number) for number in numbers])
    else:
        _save(target, [picture for index in indices for picture in render(scene(recipe, seed, index), exposed=False)])
    return len(indices)


def _save(target: Path, pictures: list[Picture]) -> None:
    images = target.with_suffix(".npy")
    np.save(images, np.stack([np.dstack([picture.image, picture.cover]) for picture in pictures]))
    labels = [picture.labels for picture in pictures]
    partial = target.with_suffix(".part")
    with partial.open("wb") as file:
        np.savez(
            file,
            counts=np.array([len(one.classes) for one in labels]),
            classes=np.concatenate([one.classes for one in labels]),
            boxes_xyxy=np.concatenate([one.boxes_xyxy for one in labels]),
            shares=np.concatenate([one.shares for one in labels]),
            distances_m=np.concatenate([one.distances_m for one in labels]),
        )
    partial.rename(target)  # last: a shard that has its labels is whole


def _digest(files: Iterable[Path]) -> str:
    whole = hashlib.sha256()
    for file in files:
        with file.open("rb") as stream:
            whole.update(hashlib.file_digest(stream, "sha256").digest())
    return whole.hexdigest()


class PictureSet:
    """A folder of pictures that `make` rendered: images stay on disk until they are asked for.

    Raises:
        FileNotFoundError: the folder has no finished set.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.digest: str = json.loads((folder / _INDEX).read_text(encoding="utf-8"))["sha256"]
        self._images: list[Image] = []
        self.labels: list[Labels] = []
        self._place: list[tuple[int, int]] = []
        self.painted: list[int] = []
        """The numbers of those that are painted, and of the others."""
        self.rendered: list[int] = []
        for shard, file in enumerate(sorted(folder.glob("*.npz"))):
            self._images.append(np.load(file.with_suffix(".npy"), mmap_mode="r"))
            with np.load(file) as data:
                ends = np.cumsum(data["counts"])[:-1]
                columns = [np.split(data[name], ends) for name in ("classes", "boxes_xyxy", "shares", "distances_m")]
            self.labels += [Labels(*row) for row in zip(*columns, strict=True)]
            numbers = range(len(self._place), len(self._place) + len(columns[0]))
            (self.painted if file.name.startswith(PAINTED) else self.rendered).extend(numbers)
            self._place += [(shard, row) for row in range(len(columns[0]))]

    def __reduce__(self) -> tuple[type["PictureSet"], tuple[Path]]:
        """Another process opens the files anew: pickled, mapped images would travel whole."""
        return PictureSet, (self._folder,)

    def __len__(self) -> int:
        return len(self.labels)

    def image(self, index: int) -> Image:
        """One image (H, W, 4): RGB, and how much of each pixel is covered; not to be written to."""
        shard, row = self._place[index]
        return np.asarray(self._images[shard][row])
