"""ImageAnnotations: outlines and texts that Foxglove draws over an image."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.parts import Array, make, stamp_from_ros, stamp_to_ros
from mcap_landmarks.messages.typestore import RosObject

Color = tuple[float, float, float, float]
_LINE_LOOP = 2  # of foxglove_msgs/PointsAnnotation


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A closed line through pixels_uv (N, 2)."""

    pixels_uv: Array
    color: Color
    thickness_px: float


@dataclass(frozen=True, slots=True)
class Label:
    """A text with its lower left corner at a pixel."""

    pixel_uv: tuple[float, float]
    text: str
    size_px: float
    color: Color
    background: Color


@dataclass(frozen=True, slots=True, eq=False)
class ImageAnnotations:
    """Outlines and labels of one image; the stamp must equal the image's, else Foxglove does not show them."""

    ROS_TYPE: ClassVar[str] = "foxglove_msgs/msg/ImageAnnotations"

    stamp_ns: int
    outlines: tuple[Outline, ...]
    labels: tuple[Label, ...]

    def to_ros(self) -> RosObject:
        """See `Message`."""
        stamp = stamp_to_ros(self.stamp_ns)
        points = [
            make(
                "foxglove_msgs/PointsAnnotation",
                timestamp=stamp,
                type=_LINE_LOOP,
                points=[_point(*pixel) for pixel in outline.pixels_uv.tolist()],
                outline_color=_color(outline.color),
                outline_colors=[],
                fill_color=_color((0.0, 0.0, 0.0, 0.0)),
                thickness=outline.thickness_px,
            )
            for outline in self.outlines
        ]
        texts = [
            make(
                "foxglove_msgs/TextAnnotation",
                timestamp=stamp,
                position=_point(*label.pixel_uv),
                text=label.text,
                font_size=label.size_px,
                text_color=_color(label.color),
                background_color=_color(label.background),
            )
            for label in self.labels
        ]
        return make("foxglove_msgs/ImageAnnotations", circles=[], points=points, texts=texts)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`; annotations without any outline or label have the stamp 0."""
        stamps = [item.timestamp for item in (*ros.points, *ros.texts)]
        outlines = tuple(
            Outline(
                np.array([[point.x, point.y] for point in item.points], dtype=np.float64).reshape(-1, 2),
                _rgba(item.outline_color),
                item.thickness,
            )
            for item in ros.points
        )
        labels = tuple(
            Label(
                (item.position.x, item.position.y),
                item.text,
                item.font_size,
                _rgba(item.text_color),
                _rgba(item.background_color),
            )
            for item in ros.texts
        )
        return cls(stamp_from_ros(stamps[0]) if stamps else 0, outlines, labels)


def _point(u: float, v: float) -> RosObject:
    return make("foxglove_msgs/Point2", x=u, y=v)


def _color(rgba: Color) -> RosObject:
    r, g, b, a = rgba
    return make("foxglove_msgs/Color", r=r, g=g, b=b, a=a)


def _rgba(color: RosObject) -> Color:
    return color.r, color.g, color.b, color.a
