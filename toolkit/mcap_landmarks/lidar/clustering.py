"""The objects of one scan: segments, clusters of segments, and the shapes of classes held against them."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mcap_landmarks.classes import Box, Disc, Legs, Section
from mcap_landmarks.lidar import shapes
from mcap_landmarks.lidar.beams import Beams
from mcap_landmarks.lidar.cells import Noise
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.objects import Hypotheses, objects
from mcap_landmarks.lidar.segments import Breaks, Cluster, near_clusters, segments
from mcap_landmarks.lidar.shapes import Shape

Shapes = Mapping[str, Sequence[Shape]]

# Without any shape to compare with, what is larger than this across twice is background.
_WITHOUT_SHAPES_M = 1.0


def shapes_of(config: ClusterConfig) -> Shapes:
    """The shapes of every class that has any."""
    return {name: tuple(map(_shape, options)) for name, options in config.shapes.items() if options}


def _shape(section: Section) -> Shape:
    """A cross-section as rays meet it."""
    match section:
        case Disc():
            return shapes.disc(section.radius_m)
        case Legs():
            return shapes.legs(section.radius_m, (min(section.apart_m), max(section.apart_m)))
        case Box():
            corner_m = min(section.corner_m, section.length_m / 2, section.width_m / 2)
            return shapes.box(section.length_m, section.width_m, corner_m)
        case _:
            return Shape(section.discs, section.boxes, turn_rad=2 * math.pi / section.symmetry)


def cluster(beams: Beams, shapes: Shapes, config: ClusterConfig) -> list[Hypotheses]:
    """The objects of one scan, in the base frame; `shapes` are those of the configuration."""
    return objects(beams, pieces(beams, shapes, config), shapes, noise_of(config))


def pieces(beams: Beams, shapes: Shapes, config: ClusterConfig) -> list[Cluster]:
    """What of a scan can be objects, before shapes say what belongs together."""
    reach = max((shape.reach_m for options in shapes.values() for shape in options), default=_WITHOUT_SHAPES_M)
    largest = 2 * reach + 6 * config.sigma_m if config.largest_m is None else config.largest_m
    breaks = Breaks(np.deg2rad(config.incidence_deg), config.sigma_m, config.link_m)
    return near_clusters(beams, segments(beams, breaks, largest), config.near_m)


def noise_of(config: ClusterConfig) -> Noise:
    """The noise that a configuration assumes."""
    return Noise(config.sigma_m, config.dropout, config.stray)
