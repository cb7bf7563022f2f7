"""Shapes side by side, so that one look-up serves rays that meet different ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.shapes import OFFSETS, Shape, profile

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

PAST_M = np.float32(1e5)
"""The depth of rays that pass a shape: beyond every range, and finite."""


@dataclass(frozen=True, slots=True, eq=False)
class ShapeTable:
    """S shapes: the depths of their profiles one after the other, and per shape (S,) where they begin and their layout.

    reach_m, turn_rad as the shapes have them; span_m: how much the largest size is wider than the smallest;
    least_width_m as the profiles have it.
    """

    depths_m: Floats
    starts: Ints
    sizes: Ints
    turns: Ints
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
            steps_m=self.steps_m[which],
            reach_m=self.reach_m[which],
            turn_rad=self.turn_rad[which],
            span_m=self.span_m[which],
            least_width_m=self.least_width_m[which],
        )

    def look_up(self, rays: tuple[NDArray[np.intp], Floats, Floats], turns_rad: Floats, sizes: Floats) -> Floats:
        """Depths (P, K) at which rays meet the shapes of their rows, `PAST_M` where they pass them.

        Rays have rows (P,), headings in rad (P, 1), and offsets in m (P, K); the shapes of R rows are turned, and have
        sizes in 0 to 1, (R, K).
        """
        row, headings_rad, offsets_m = rays
        place = offsets_m * (1 / self.steps_m)[row, None]
        place += np.float32(OFFSETS // 2 + 0.5)
        index = np.clip(place, np.float32(0), np.float32(OFFSETS - 1), out=place).astype(np.int32)
        if (self.turns > 1).any():
            turns, per_rad = self.turns[row, None], (1 / self.turn_rad).astype(np.float32)
            turned = headings_rad * per_rad[row, None] + (0.5 / turns).astype(np.float32)
            turned = turned - (turns_rad * per_rad[:, None])[row]
            turned -= np.floor(turned)
            turned *= turns.astype(np.float32)
            index += np.minimum(turned.astype(np.int32), turns - 1) * np.int32(OFFSETS)
        size = np.clip((sizes * self.sizes[:, None]).astype(np.int32), 0, self.sizes[:, None] - 1)
        index += (size * (self.turns * OFFSETS)[:, None] + self.starts[:, None]).astype(np.int32)[row]
        return self.depths_m.take(index)


def shape_table(shapes: Sequence[Shape]) -> ShapeTable:
    """The profiles of shapes, made once."""
    return _shape_table(tuple(shapes))


@cache
def _shape_table(shapes: tuple[Shape, ...]) -> ShapeTable:
    profiles = [profile(shape) for shape in shapes]
    layout = np.array([one.depths_m.shape for one in profiles], dtype=np.int32).reshape(-1, 3)
    ends = np.cumsum(layout.prod(axis=1))
    depths = [np.minimum(one.depths_m, PAST_M).ravel() for one in profiles]
    sizes, turns, _ = layout.T
    return ShapeTable(
        np.concatenate(depths) if depths else np.zeros(0, dtype=np.float32),
        (ends - layout.prod(axis=1)).astype(np.int32),
        sizes,
        turns,
        np.array([one.step_m for one in profiles], dtype=np.float32),
        np.array([shape.reach_m for shape in shapes]),
        np.array([shape.turn_rad for shape in shapes]),
        np.array([0.0 if shape.apart_m is None else shape.apart_m[1] - shape.apart_m[0] for shape in shapes]),
        np.array([one.least_width_m for one in profiles]),
    )
