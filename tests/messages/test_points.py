"""Point clouds as drivers make them: other fields, padding, rows, doubles, the other byte order."""

import numpy as np
import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.parts import header_to_ros, make
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.typestore import typestore
from numpy.typing import NDArray

POINTS = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [-1.0, 0.5, 0.25], [7.0, 8.0, 9.0]])


Layout = list[tuple[str, str]]


def cloud(
    layout: Layout, rows: int = 1, padding: int = 0, times: NDArray[np.float64] | None = None, **changes: object
) -> bytes:
    """A cloud of POINTS in a numpy layout with fields x, y, z and others, as CDR; times go into the others."""
    kinds = {"f4": 7, "f8": 8, "u2": 4, "u4": 6, "i4": 5}
    dtype = np.dtype(layout)
    content = np.zeros(len(POINTS), dtype)
    for i, name in enumerate("xyz"):
        if name in dtype.names:
            content[name] = POINTS[:, i]
    for name in set(dtype.names) - set("xyz") if times is not None else ():
        content[name] = times
    fields = [
        make("sensor_msgs/PointField", name=name, offset=offset, datatype=kinds[kind.str[1:]], count=1)
        for name, (kind, offset) in dtype.fields.items()
    ]
    width = len(POINTS) // rows
    data = np.concatenate([np.r_[row.view(np.uint8), np.zeros(padding, np.uint8)] for row in content.reshape(rows, -1)])
    values = {
        "header": header_to_ros(5, "lidar"),
        "height": rows,
        "width": width,
        "fields": fields,
        "is_bigendian": dtype["x"].str.startswith(">") if "x" in dtype.names else False,
        "point_step": dtype.itemsize,
        "row_step": width * dtype.itemsize + padding,
        "data": data,
        "is_dense": False,
    } | changes
    return bytes(typestore().serialize_cdr(make("sensor_msgs/PointCloud2", **values), PointCloud2.ROS_TYPE))


@pytest.mark.parametrize(
    ("layout", "rows", "padding"),
    [
        ([("x", "<f4"), ("y", "<f4"), ("z", "<f4")], 1, 0),
        ([("ring", "<u2"), ("z", "<f4"), ("x", "<f4"), ("y", "<f4"), ("t", "<f8")], 2, 0),
        ([("x", "<f8"), ("y", "<f8"), ("z", "<f8")], 2, 7),
        ([("x", ">f4"), ("y", ">f4"), ("z", ">f4"), ("ring", ">u2")], 1, 3),
    ],
)
def test_layouts(layout: Layout, rows: int, padding: int) -> None:
    found = decode(PointCloud2, cloud(layout, rows, padding))
    assert (found.stamp_ns, found.frame_id) == (5, "lidar")
    np.testing.assert_array_equal(found.points_m, POINTS.astype(np.float32))


def test_a_single_row_needs_no_step_to_the_next() -> None:
    found = decode(PointCloud2, cloud([("x", "<f4"), ("y", "<f4"), ("z", "<f4")], row_step=0))
    np.testing.assert_array_equal(found.points_m, POINTS.astype(np.float32))
    with pytest.raises(MessageError, match="bytes only"):
        decode(PointCloud2, cloud([("x", "<f4"), ("y", "<f4"), ("z", "<f4")], rows=2, row_step=0))


@pytest.mark.parametrize(
    ("layout", "changes", "said"),
    [
        ([("x", "<f4"), ("y", "<f4")], {}, "has no x, y and z"),
        ([("x", "<u2"), ("y", "<f4"), ("z", "<f4")], {}, "not a float"),
        ([("x", "<f4"), ("y", "<f4"), ("z", "<f4")], {"width": 9, "row_step": 108}, "bytes only"),
        ([("x", "<f4"), ("y", "<f4"), ("z", "<f4")], {"point_step": 8}, "not a sensor_msgs/msg/PointCloud2"),
    ],
)
def test_what_cannot_be_is_refused(layout: Layout, changes: dict[str, object], said: str) -> None:
    with pytest.raises(MessageError, match=said):
        decode(PointCloud2, cloud(layout, **changes))


XYZ: Layout = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
STAMP_NS = 1_700_000_000_250_000_000
SWEEP_NS = np.array([0, 40_000_000, 70_000_000, 100_000_000])
BACK_NS = SWEEP_NS - 100_000_000


def times_of(times: NDArray[np.floating], stamp_ns: int, *fields: tuple[str, str]) -> NDArray[np.int64] | None:
    header = header_to_ros(stamp_ns, "lidar")
    return decode(PointCloud2, cloud([*XYZ, *fields], 2, times=times.astype(np.float64), header=header)).times_ns


@pytest.mark.parametrize(
    ("name", "kind", "times", "stamp_ns", "expected_ns"),
    [
        ("t", "<u4", SWEEP_NS, STAMP_NS, SWEEP_NS),
        ("offset_time", "<u4", SWEEP_NS, 0, SWEEP_NS),
        ("time_stamp", "<i4", BACK_NS, STAMP_NS, BACK_NS),
        ("time", "<f4", SWEEP_NS * 1e-9, STAMP_NS, SWEEP_NS),
        ("time", "<f4", BACK_NS * 1e-9, 0, BACK_NS),
        ("timestamp", "<f8", SWEEP_NS * 1e-9, STAMP_NS, SWEEP_NS),
        ("timestamp", "<f8", STAMP_NS * 1e-9 + BACK_NS * 1e-9, STAMP_NS, BACK_NS),
        ("timestamp", "<f8", STAMP_NS + SWEEP_NS, STAMP_NS, SWEEP_NS),
        ("timestamp", "<f8", 5.0 + SWEEP_NS * 1e-9, 5 * 10**9, SWEEP_NS),
    ],
)
def test_times_of_points_as_drivers_write_them(
    name: str, kind: str, times: NDArray[np.floating], stamp_ns: int, expected_ns: NDArray[np.int64]
) -> None:
    found = times_of(times, stamp_ns, (name, kind))
    assert found is not None
    expected = np.where(np.isnan(POINTS).any(axis=1), 0, expected_ns)  # what did not return was never measured
    np.testing.assert_allclose(found, expected, atol=500)  # doubles since the epoch are no finer


@pytest.mark.parametrize(
    ("times", "stamp_ns", "fields"),
    [
        (SWEEP_NS * 1e-6, STAMP_NS, [("time", "<f4")]),  # milliseconds
        (SWEEP_NS / SWEEP_NS[-1], STAMP_NS, [("time", "<f4")]),  # a share of the turn
        (STAMP_NS * 1e-9 + SWEEP_NS * 1e-9 + 37, STAMP_NS, [("timestamp", "<f8")]),  # another clock, leap seconds off
        (0.3 + SWEEP_NS * 1e-9, 3 * 10**8, [("timestamp", "<f8")]),  # after the stamp, or since the epoch?
        (np.full(4, 5e7), STAMP_NS, [("t", "<u4")]),  # all at once
        (SWEEP_NS * 1e-9, STAMP_NS, [("time", "<f4"), ("timestamp", "<f8")]),
        (SWEEP_NS * 1e-9, STAMP_NS, [("seconds", "<f4")]),
        (np.array([0, 1, 2, 3.0]), STAMP_NS, [("t", "<u2")]),
        (np.array([np.nan, 0, 0.05, 0.1]), STAMP_NS, [("time", "<f4")]),
    ],
)
def test_times_that_are_not_clear_are_none(
    times: NDArray[np.floating], stamp_ns: int, fields: list[tuple[str, str]]
) -> None:
    assert times_of(times, stamp_ns, *fields) is None


def test_times_come_back() -> None:
    written = PointCloud2(STAMP_NS, "lidar", POINTS.astype(np.float32), np.array([-5, 0, 7, 100_000_000]))
    found = decode(PointCloud2, encode(written))
    np.testing.assert_array_equal(found.points_m, written.points_m)
    np.testing.assert_array_equal(found.times_ns, [-5, 0, 7, 100_000_000])
    assert found.duration_ns == 100_000_005
    assert PointCloud2(STAMP_NS, "lidar", POINTS.astype(np.float32)).duration_ns == 0
