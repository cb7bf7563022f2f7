"""The pictures to train on: what worlds hold, that they are reproducible, and that labels fit what is drawn."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet")

from mcap_landmarks_generator.assets.catalog import COCO_ID, HELD_OUT_SEEDS, TRAIN_SEEDS
from mcap_landmarks_generator.training import clutter
from mcap_landmarks_generator.training.examples import CLASS_IDS, Examples, Phase
from mcap_landmarks_generator.training.pictures import PictureSet, make, render
from mcap_landmarks_generator.training.worlds import THESIS_CLASSES, TRAINING, judged, scene

RECIPES = [(TRAINING, 1), (judged("empty", TRAIN_SEEDS), 1)]


@pytest.mark.slow
def test_a_scene_depends_on_its_index_only() -> None:
    first, again, other = scene(TRAINING, 3, 5), scene(TRAINING, 3, 5), scene(TRAINING, 3, 6)
    assert [one.object_id for one in first.objects] == [one.object_id for one in again.objects]
    assert np.array_equal(first.views[0].eye_m, again.views[0].eye_m)
    assert not np.array_equal(first.views[0].eye_m, other.views[0].eye_m)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["thesis", "twelve", "empty"])
def test_held_out_worlds_are_of_their_kind_and_look_like_nothing_trained_on(kind: str) -> None:
    one = scene(judged(kind, HELD_OUT_SEEDS), 10_000, 0)  # type: ignore[arg-type]
    names = {placed.asset.name for placed in one.objects if placed.is_landmark}
    assert names <= {"thesis": set(THESIS_CLASSES), "twelve": set(COCO_ID), "empty": set()}[kind]
    assert bool(names) == (kind != "empty")
    assert all(placed.asset.seed in HELD_OUT_SEEDS for placed in one.objects)
    assert all(placed.asset.seed in TRAIN_SEEDS for placed in scene(TRAINING, 1, 0).objects)


@pytest.mark.slow
def test_objects_stand_free_of_each_other_and_of_the_camera() -> None:
    one = scene(TRAINING, 1, 1)
    spots = np.array([placed.route_xy[0] for placed in one.objects])
    reach = np.array([placed.asset.footprint_radius_m for placed in one.objects])
    gaps = np.hypot(*(spots[:, None] - spots[None]).transpose(2, 0, 1)) - reach[:, None] - reach[None]
    assert gaps[~np.eye(len(spots), dtype=bool)].min() > 0
    for view in one.views:
        assert (np.hypot(*(spots - view.eye_m[:2]).T) - reach).min() > 1.0


@pytest.mark.slow
def test_bearings_point_at_the_middle_of_whole_objects() -> None:
    for picture in render(scene(judged("thesis", TRAIN_SEEDS), 7_000, 0), exposed=True):
        boxes, whole = picture.labels.boxes_xyxy, picture.labels.shares == 1.0
        inside = whole & (boxes[:, 0] > 0) & (boxes[:, 2] < 640) & (picture.labels.distances_m > 4)
        columns = 320 - np.tan(picture.bearings_rad[inside]) * 530.5
        sides = boxes[inside]
        assert (sides[:, 0] - 1 < columns).all()
        assert (columns < sides[:, 2] + 1).all()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures")
    assert list(make(path, RECIPES, seed=5, painted_scenes=1)) == [0, 1, 2, 3]
    return path


@pytest.mark.slow
def test_a_finished_set_is_kept_and_has_the_same_digest(folder: Path, tmp_path: Path) -> None:
    digest = PictureSet(folder).digest
    assert list(make(folder, RECIPES, seed=5, painted_scenes=1)) == [3]
    list(make(tmp_path / "again", RECIPES, seed=5, workers=2, painted_scenes=1))
    assert PictureSet(folder).digest == PictureSet(tmp_path / "again").digest == digest


@pytest.mark.slow
def test_painted_pictures_have_neither_labels_nor_cover_and_rendered_ones_cover_their_labels(folder: Path) -> None:
    pictures = PictureSet(folder)
    assert (len(pictures.painted), len(pictures.rendered)) == (8, 16)
    for index in pictures.painted:
        assert not pictures.image(index)[..., 3].any()
        assert not len(pictures.labels[index].classes)
    labels = [(pictures.image(index), box) for index in pictures.rendered for box in pictures.labels[index].boxes_xyxy]
    assert len(labels) > 10
    for image, (left, top, right, bottom) in ((image, box.astype(int)) for image, box in labels):
        assert image[top : bottom + 1, left : right + 1, 3].max() > 100


def test_paintings_depend_on_seed_and_index_only_and_differ() -> None:
    pictures = [clutter.paint(3, index) for index in range(2)]
    assert np.array_equal(clutter.paint(3, 1), pictures[1])
    assert not np.array_equal(clutter.paint(4, 1), pictures[1])
    assert all(picture.shape == (480, 640, 3) and picture.std() > 5 for picture in pictures)


@pytest.mark.slow
def test_examples_depend_on_their_step_only_and_change_size_by_phase(folder: Path) -> None:
    phases = Phase(3, 4, 320, 320), Phase(2, 2, 480, 640)
    examples, again = (Examples(PictureSet(folder), phases, 0) for _ in range(2))
    assert len(examples) == 5
    for step in (4, 0, 3):
        assert np.array_equal(examples[step].images, again[step].images)
        assert np.array_equal(examples[step].targets, again[step].targets)
    assert examples[2].images.shape == (4, 320, 320, 3)
    assert examples[3].images.shape == (2, 480, 640, 3)


@pytest.mark.slow
def test_targets_lie_in_their_example(folder: Path) -> None:
    examples = Examples(PictureSet(folder), (Phase(6, 8, 320, 320),), 1)
    targets = np.concatenate([examples[step].targets for step in range(4)])
    assert len(targets) > 20
    assert set(targets[:, 0]) <= set(range(8))
    assert set(targets[:, 1]) <= set(range(len(CLASS_IDS)))
    low, high = targets[:, 2:4] - targets[:, 4:] / 2, targets[:, 2:4] + targets[:, 4:] / 2
    assert low.min() >= -1e-3
    assert high.max() <= 320 + 1e-3
    assert targets[:, 4:].min() > 3
