"""PointCloud2: only where its points are, and when each was measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.parts import header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject

_INT32, _UINT32, _FLOAT32, _FLOAT64 = 5, 6, 7, 8
_PLACES = {_FLOAT32: "f4", _FLOAT64: "f8"}
_TIMES = {_INT32: "i4", _UINT32: "u4"} | _PLACES
_TIME_NAMES = frozenset({"t", "time", "timestamp", "time_stamp", "offset_time", "time_offset"})
_LONGEST_NS = 500_000_000
"""Points that are said to be farther from their cloud's stamp have wrong times: LiDARs turn at 5 to 20 Hz."""


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud2:
    """Points of a LiDAR or depth camera: points_m (N, 3) in `frame_id`, not finite where there was no return.

    times_ns (N,) is how long after the stamp each was measured, less than zero before it; None where the cloud does not
    say, or not clearly. PointCloud2 has no rule for it: drivers name the field `t`, `time`, `timestamp`, `time_stamp`,
    `offset_time` or `time_offset`, and write integers in nanoseconds after the stamp (Ouster, Livox, Nebula), single
    floats in seconds after it (Velodyne), or doubles in seconds after it, in seconds since the epoch (Hesai, RoboSense)
    or in nanoseconds since then (Livox). It counts where just one of these puts every point within 0.5 s of the stamp.
    """

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/PointCloud2"

    stamp_ns: int
    frame_id: str
    points_m: NDArray[np.float32]
    times_ns: NDArray[np.int64] | None = None

    @property
    def duration_ns(self) -> int:
        """How long the sweep took; 0 where the cloud does not say."""
        return 0 if self.times_ns is None or not len(self.times_ns) else int(np.ptp(self.times_ns))

    def to_ros(self) -> RosObject:
        """See `Message`; one row of points with fields x, y and z, and t where times are known."""
        columns = {name: self.points_m[:, i] for i, name in enumerate("xyz")}
        if self.times_ns is not None:
            columns["t"] = self.times_ns.astype(np.int32)
        return cloud_to_ros(header_to_ros(self.stamp_ns, self.frame_id), columns)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`; whatever else a point has is left out.

        Raises:
            MessageError: there are no x, y and z, or the data are shorter than they say.
        """
        fields = {field.name: field for field in ros.fields}
        if not {"x", "y", "z"} <= fields.keys():
            raise MessageError(f"a point cloud with the fields {', '.join(fields) or 'none'} has no x, y and z")
        order = ">" if ros.is_bigendian else "<"
        places = {name: order + _coordinate(fields[name]) for name in "xyz"}
        times = {name: order + _TIMES[field.datatype] for name, field in fields.items() if _is_time(field)}
        layout = {**places, **times}
        points = points_from_ros(ros, layout)
        xyz = np.stack([np.asarray(points[name], dtype=np.float32) for name in "xyz"], axis=1)
        stamp_ns = stamp_from_ros(ros.header.stamp)
        returned = np.array(np.isfinite(xyz).all(axis=1), dtype=np.bool_)
        times_ns = _times_ns(points[next(iter(times))], returned, stamp_ns) if len(times) == 1 else None
        return cls(stamp_ns, ros.header.frame_id, xyz, times_ns)


def _coordinate(field: RosObject) -> str:
    """The format of a field that is a coordinate, without the order of its bytes."""
    if field.datatype not in _PLACES:
        raise MessageError(f"the {field.name} of a point cloud is of type {field.datatype}, not a float")
    return _PLACES[field.datatype]


def _is_time(field: RosObject) -> bool:
    return field.name in _TIME_NAMES and field.datatype in _TIMES


def cloud_to_ros(header: RosObject, columns: Mapping[str, NDArray[np.float32] | NDArray[np.int32]]) -> RosObject:
    """A `sensor_msgs/PointCloud2` of one row of points, whose fields are columns (N,) by name, four bytes each."""
    points = np.zeros(
        len(next(iter(columns.values()))), [(name, f"<{values.dtype.kind}4") for name, values in columns.items()]
    )
    for name, values in columns.items():
        points[name] = values
    fields = [
        make(
            "sensor_msgs/PointField",
            name=name,
            offset=4 * i,
            datatype=_INT32 if values.dtype.kind == "i" else _FLOAT32,
            count=1,
        )
        for i, (name, values) in enumerate(columns.items())
    ]
    return make(
        "sensor_msgs/PointCloud2",
        header=header,
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=points.itemsize,
        row_step=points.nbytes,
        data=points.view(np.uint8),
        is_dense=all(bool(np.isfinite(values).all()) for values in columns.values()),
    )


def points_from_ros(ros: RosObject, layout: Mapping[str, str]) -> NDArray[np.void]:
    """The points of a cloud of the typestore, one after the other, with the fields of a layout: formats by name.

    Raises:
        MessageError: the data are shorter than they say.
    """
    names, formats = list(layout), list(layout.values())
    offsets = [next(field.offset for field in ros.fields if field.name == name) for name in names]
    point = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": int(ros.point_step)})
    rows = np.ascontiguousarray(ros.data).reshape(-1)
    row_bytes = ros.width * ros.point_step
    step = ros.row_step if ros.height > 1 else row_bytes  # of a single row nothing follows
    if len(rows) < ros.height * step or step < row_bytes:
        raise MessageError(f"a point cloud of {ros.width} x {ros.height} points has {len(rows)} bytes only")
    rows = rows[: ros.height * step].reshape(ros.height, -1)[:, :row_bytes]
    return np.frombuffer(np.ascontiguousarray(rows).data, dtype=point)


def _times_ns(values: NDArray[np.number], returned: NDArray[np.bool_], stamp_ns: int) -> NDArray[np.int64] | None:
    """Times (N,) after the stamp, zero where nothing returned; None where it is not clear what the values mean."""
    readings = [np.where(returned, values, 0).astype(np.float64)]
    if values.dtype.kind == "f":
        seconds = readings[0]
        readings = [seconds * 1e9]
        if values.dtype.itemsize == 8:  # single floats are too coarse for times since the epoch
            readings += [(seconds - stamp_ns / 1e9) * 1e9, seconds - stamp_ns]
    sound = [times for times in readings if _is_sweep(times[returned])]
    return np.where(returned, sound[0], 0).round().astype(np.int64) if len(sound) == 1 else None


def _is_sweep(times_ns: NDArray[np.float64]) -> bool:
    """Whether times (N,) after a cloud's stamp can be those of its points: not all the same, and none far off."""
    return len(times_ns) > 0 and float(np.ptp(times_ns)) > 0 and bool((np.abs(times_ns) <= _LONGEST_NS).all())
