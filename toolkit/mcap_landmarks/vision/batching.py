"""Several images through a network in one call: on a GPU, where the network's batch axis is free."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.detector import Detector

Item = TypeVar("Item")


def takes_several(detector: Detector) -> bool:
    """Whether a network takes any number of images, and each of its outputs tells them apart."""
    images, *others = detector.session.inputs
    return images.shape[0] is None and not others and detector.layout.by_image


def images_at_once(detector: Detector, wanted: int) -> int:
    """How many images a call takes: on a CPU one, which is as fast, and always has the same bytes."""
    return wanted if detector.session.provider != "cpu" and takes_several(detector) else 1


def groups_of(items: Iterable[Item], size: int) -> Iterator[list[Item]]:
    """The items in lists of `size`, the last one shorter."""
    stream = iter(items)
    while group := list(islice(stream, size)):
        yield group


def run_together(detector: Detector, arrays: Sequence[NDArray[np.floating]], at_once: int) -> list[list[NDArray[Any]]]:
    """The outputs for each input (1, 3, height, width), of calls with `at_once` inputs of one size.

    A call with fewer is filled up with zeros: what is found in an image does not depend on how many others there are,
    and TensorRT builds one engine.

    Raises:
        ModelError: the model cannot take these inputs.
    """
    if at_once == 1:
        return [detector.run(array) for array in arrays]
    by_size = defaultdict(list)
    for i, array in enumerate(arrays):
        by_size[array.shape].append(i)
    found: dict[int, list[NDArray[Any]]] = {}
    for places in (group for same in by_size.values() for group in groups_of(same, at_once)):
        outputs = _outputs(detector, [arrays[i] for i in places], at_once)
        found.update((place, [output[row : row + 1] for output in outputs]) for row, place in enumerate(places))
    return [found[i] for i in range(len(arrays))]


def _outputs(detector: Detector, arrays: Sequence[NDArray[np.floating]], at_once: int) -> list[NDArray[Any]]:
    stack = np.zeros((at_once, *arrays[0].shape[1:]), detector.dtype)
    stack[: len(arrays)] = np.concatenate(arrays)
    outputs = detector.run(stack)
    if any(len(output) != at_once for output in outputs):
        raise ModelError(
            f"{detector.path}: for {at_once} images its outputs have other lengths, though its batch axis is free; "
            "export it again, or give --set detect.batch=1"
        )
    return outputs
