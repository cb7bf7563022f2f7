"""What is compared in a message: its fields, and the detections, objects, transforms, markers or poses in it."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.diff.pairs import Pairs, pair_boxes, pair_keys, pair_points
from mcap_landmarks.diff.values import Array, Rows, of_rows
from mcap_landmarks.messages.columns import Column, Kind, Table
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.poses import Path
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage

_WORDS = {
    "header.frame_id": "frame_id",
    "header.stamp": "stamp_ns",
    "pose.position": "position_m",
    "pose.orientation": "orientation",
    "pose.pose.position": "position_m",
    "pose.pose.orientation": "orientation",
    "pose.covariance": "covariance",
    "hypothesis.class_id": "class",
    "hypothesis.score": "score",
    "transform.translation": "translation_m",
    "transform.rotation": "rotation",
    "bbox.center.orientation": "box_orientation",
    "bbox.center.theta": "box_theta",
    "bbox.size": "size_m",
    "scale": "size_m",
}


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """Columns by name; `counted` are those that say how many elements a sequence has, whose fields begin with them."""

    columns: Mapping[str, Column]
    counted: tuple[str, ...] = ()

    def take(self, rows: Rows) -> "Fields":
        """Some of the rows."""
        return Fields({name: of_rows(column, rows) for name, column in self.columns.items()}, self.counted)


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """N rows of one side: their fields, what each is called (N,), and their times in nanoseconds (N,) or None."""

    fields: Fields
    labels: NDArray[np.object_]
    times: Rows | None

    def take(self, rows: Rows) -> "Batch":
        """Some of the rows."""
        return Batch(self.fields.take(rows), self.labels[rows], None if self.times is None else self.times[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Items:
    """The N things in M messages: how many each message has (M,), their fields, and what each is called (N,).

    They belong together by `boxes` (N, 4), by `points` (N, 2), or by `keys` (N).
    """

    counts: Rows
    fields: Fields
    labels: NDArray[np.object_]
    boxes: Array | None = None
    points: Array | None = None
    keys: tuple[Hashable, ...] = ()

    @property
    def messages(self) -> Rows:
        """The message (N,) that each is in."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def ids(self) -> Column | None:
        """Their ids (N, 1), where these are names that a run gives as it likes."""
        return None if self.keys else self.fields.columns.get("id")

    @property
    def places(self) -> Rows:
        """The place (N,) that each has among those of its message."""
        return np.arange(len(self.labels)) - np.repeat(np.cumsum(self.counts) - self.counts, self.counts)

    def batch(self, times: Rows | None) -> Batch:
        """The items as rows; `times` (M,) are those of the messages."""
        return Batch(self.fields, self.labels, None if times is None else times[self.messages])


@dataclass(frozen=True, slots=True, eq=False)
class ComparedMessages:
    """N messages as they are compared: the fields of each, and the items in them, if they are lists of such."""

    rows: int
    fields: Fields
    items: Items | None = None

    def batch(self, times: Rows | None) -> Batch:
        """The messages as rows, at `times` (N,)."""
        return Batch(self.fields, np.full(self.rows, b"", dtype=object), times)


def compared(ros_type: str, table: Table) -> ComparedMessages:
    """What there is to compare in messages of a type."""
    if ros_type in _LISTS:
        _, path, make = _LISTS[ros_type]
        return ComparedMessages(table.rows, _fields(table, without=path), make(*table.children[path]))
    fields = _fields(table)
    return ComparedMessages(table.rows, _with_status_names(fields) if ros_type == LandmarkMatch.ROS_TYPE else fields)


def pair_items(baseline: Items, candidate: Items) -> Pairs:
    """Which item is which, where message i of one belongs to message i of the other."""
    classes = baseline.labels, candidate.labels
    if baseline.boxes is not None and candidate.boxes is not None:
        return pair_boxes((baseline.counts, candidate.counts), (baseline.boxes, candidate.boxes), classes)
    if baseline.points is not None and candidate.points is not None:
        return pair_points((baseline.messages, candidate.messages), (baseline.points, candidate.points), classes)
    keys = [list(zip(side.messages.tolist(), side.keys, strict=True)) for side in (baseline, candidate)]
    return pair_keys(*keys)


def _fields(table: Table, without: str = "") -> Fields:
    columns, counted = _flat(table, without)
    return Fields({_WORDS.get(name, name): column for name, column in columns.items()}, tuple(counted))


def _flat(table: Table, without: str = "") -> tuple[dict[str, Column], list[str]]:
    """Columns of all depths, as many rows as the table has, and the names of those that count elements."""
    columns, counted = dict(table.columns), []
    for path, (counts, child) in table.children.items():
        if path == without:
            continue
        columns[path] = Column(Kind.NUMBER, counts[:, None])
        inner, deeper = _flat(child)
        counted += [path, *(f"{path}.{name}" for name in deeper)]
        row_of = np.repeat(np.arange(table.rows), counts)
        for name, column in inner.items():
            lengths = counts
            if column.counts is not None:
                lengths = np.bincount(row_of, weights=column.counts, minlength=table.rows).astype(np.int64)
            columns[f"{path}.{name}"] = Column(column.kind, column.values, lengths)
    return columns, counted


def _with_status_names(fields: Fields) -> Fields:
    names = {status.value: status.name.lower().encode() for status in Status}
    numbers = fields.columns["status"].values[:, 0].tolist()
    words = texts([names.get(number, str(number).encode()) for number in numbers])
    return Fields({**fields.columns, "status": Column(Kind.TEXT, words[:, None])}, fields.counted)


def _detections(counts: Rows, table: Table) -> Items:
    fields, first = _with_results(table)
    columns = dict(fields.columns)
    centre = columns.pop("bbox.center.position").values
    half = np.column_stack([columns.pop("bbox.size_x").values, columns.pop("bbox.size_y").values]) / 2
    boxes = np.column_stack([centre - half, centre + half])
    columns["box_xyxy_px"] = Column(Kind.NUMBER, boxes)
    columns["pose.position"] = columns.pop("position_m")  # of a 3D estimate, which boxes seldom carry
    return Items(counts, Fields(columns, fields.counted), first["class"].values[:, 0], boxes=boxes)


def _objects(counts: Rows, table: Table) -> Items:
    fields, first = _with_results(table)
    columns = dict(fields.columns)
    centre = columns.pop("bbox.center.position").values
    position = np.where(np.isnan(first["score"].values), centre, first["position_m"].values)
    columns["position_m"] = Column(Kind.NUMBER, position)
    columns["box_offset_m"] = Column(Kind.NUMBER, centre - position)
    points = position[:, :2]
    return Items(counts, Fields(columns, fields.counted), first["class"].values[:, 0], points=points)


def _with_results(table: Table) -> tuple[Fields, dict[str, Column]]:
    """Fields of detections whose best result is spread over fields of its own; the others are `others`.

    The class of one without any result is empty, and its score NaN.
    """
    counts, results = table.children["results"]
    starts = np.cumsum(counts) - counts
    has, rest = counts > 0, np.ones(results.rows, dtype=np.bool_)
    rest[starts[has]] = False
    columns, first = {}, {}
    for path, column in results.columns.items():
        name = _WORDS.get(path, path)
        values = _filler(column, table.rows)
        values[has] = column.values[starts[has]]
        first[name] = Column(column.kind, values)
        columns[f"others.{name}"] = Column(column.kind, column.values[rest], np.maximum(counts - 1, 0))
    own = _fields(table, without="results")
    others = Column(Kind.NUMBER, np.maximum(counts - 1, 0)[:, None])
    return Fields({**own.columns, **first, "others": others, **columns}, (*own.counted, "others")), first


def _filler(column: Column, rows: int) -> NDArray[np.object_] | Array:
    if column.kind is Kind.TEXT:
        return np.full((rows, column.values.shape[1]), b"", dtype=object)
    return np.full((rows, column.values.shape[1]), np.nan)


def _keyed(*names: str) -> Callable[[Rows, Table], Items]:
    """Items that are known by some of their fields."""

    def make(counts: Rows, table: Table) -> Items:
        fields = _fields(table)
        keys = tuple(zip(*(fields.columns[name].values[:, 0].tolist() for name in names), strict=True))
        labels = [b" ".join(part if isinstance(part, bytes) else str(part).encode() for part in key) for key in keys]
        return Items(counts, fields, texts(labels), keys=keys)

    return make


def texts(found: Sequence[bytes]) -> NDArray[np.object_]:
    """Texts as an array of objects (N,)."""
    array = np.empty(len(found), dtype=object)
    array[:] = found
    return array


_LISTS: dict[str, tuple[str, str, Callable[[Rows, Table], Items]]] = {
    Detections.ROS_TYPE: ("detections", "detections", _detections),
    SceneObjects.ROS_TYPE: ("objects", "detections", _objects),
    TFMessage.ROS_TYPE: ("transforms", "transforms", _keyed("frame_id", "child_frame_id")),
    MarkerArray.ROS_TYPE: ("markers", "markers", _keyed("ns", "id")),
    Path.ROS_TYPE: ("poses", "poses", _keyed("stamp_ns")),
}
"""Of each type that is a list: what its items are called, where they are, and how they are made."""
MESSAGES = "messages"
LIST_UNITS = frozenset(unit for unit, _, _ in _LISTS.values())


def unit_of(ros_type: str) -> str:
    """What is counted in messages of a type: its items, or the messages themselves."""
    return _LISTS[ros_type][0] if ros_type in _LISTS else MESSAGES
