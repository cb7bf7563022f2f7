"""Point clouds as drivers make them: other fields, padding, rows, doubles, the other byte order."""

import numpy as np
import pytest

from toolkit.errors import MessageError
from toolkit.messages.codec import decode
from toolkit.messages.parts import header_to_ros, make
from toolkit.messages.points import PointCloud2
from toolkit.messages.typestore import typestore

POINTS = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [-1.0, 0.5, 0.25], [7.0, 8.0, 9.0]])


Layout = list[tuple[str, str]]


def cloud(layout: Layout, rows: int = 1, padding: int = 0, **changes: object) -> bytes:
    """A cloud of POINTS in a numpy layout with fields x, y, z and others, as CDR."""
    kinds = {"f4": 7, "f8": 8, "u2": 4}
    dtype = np.dtype(layout)
    content = np.zeros(len(POINTS), dtype)
    for i, name in enumerate("xyz"):
        if name in dtype.names:
            content[name] = POINTS[:, i]
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
