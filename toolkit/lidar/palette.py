"""Shapes side by side, so that one look-up serves rays that meet different ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array
from toolkit.lidar.shapes import Shape, profile

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Palette:
    """S shapes: the depths of their profiles one after the other, and per shape (S,) where they begin and their layout.

    reach_m, turn_rad as the shapes have them; span_m: how much the largest size is wider than the smallest;
    least_width_m as the profiles have it.
    """

    depths_m: Floats
    starts: Ints
    sizes: Ints
    turns: Ints
    offsets: Ints
    steps_m: Floats
    reach_m: Array
    turn_rad: Array
    span_m: Array
    least_width_m: Array

    def rows(self, which: NDArray[np.intp]) -> Self:
        """The layout of shapes (R,), one per row of something else."""
        return replace(
            self,
            starts=self.starts[which],
            sizes=self.sizes[which],
            turns=self.turns[which],
            offsets=self.offsets[which],
            steps_m=self.steps_m[which],
            reach_m=self.reach_m[which],
            turn_rad=self.turn_rad[which],
            span_m=self.span_m[which],
            least_width_m=self.least_width_m[which],
        )

    def look_up(self, headings_rad: Floats, offsets_m: Floats, sizes: Floats) -> Floats:
        """Depths (R, K, B) of rays that meet the shape of their row at headings and offsets; sizes (R, K) in 0 to 1."""
        per_row = (slice(None), None, None)
        last = (self.offsets - 1).astype(np.float32)[per_row]
        place = offsets_m * (1 / self.steps_m)[per_row]
        place += (self.offsets // 2 + np.float32(0.5)).astype(np.float32)[per_row]
        index = np.clip(place, 0, last, out=place).astype(np.int32)
        if (self.turns > 1).any():
            turns = self.turns[per_row]
            turn = (headings_rad * (turns / np.float32(2 * np.pi)).astype(np.float32) + np.float32(0.5)).astype(
                np.int32
            )
            turn = np.where(turn < 0, turn + turns, turn)
            index += np.minimum(turn, turns - 1) * self.offsets[per_row]
        size = np.clip((sizes * self.sizes[:, None]).astype(np.int32), 0, self.sizes[:, None] - 1)
        index += (size * (self.turns * self.offsets)[:, None] + self.starts[:, None])[..., None]
        return self.depths_m.take(index)


def palette(shapes: Sequence[Shape]) -> Palette:
    """The profiles of shapes, made once."""
    return _palette(tuple(shapes))


@cache
def _palette(shapes: tuple[Shape, ...]) -> Palette:
    profiles = [profile(shape) for shape in shapes]
    layout = np.array([one.depths_m.shape for one in profiles], dtype=np.int32).reshape(-1, 3)
    ends = np.cumsum(layout.prod(axis=1))
    depths = [one.depths_m.ravel() for one in profiles]
    sizes, turns, offsets = layout.T
    return Palette(
        np.concatenate(depths) if depths else np.zeros(0, dtype=np.float32),
        (ends - layout.prod(axis=1)).astype(np.int32),
        sizes,
        turns,
        offsets,
        np.array([one.step_m for one in profiles], dtype=np.float32),
        np.array([shape.reach_m for shape in shapes]),
        np.array([shape.turn_rad for shape in shapes]),
        np.array([0.0 if shape.apart_m is None else shape.apart_m[1] - shape.apart_m[0] for shape in shapes]),
        np.array([one.least_width_m for one in profiles]),
    )
