"""Small bags and data sets, written by rosbags and by hand, never by the code under test."""

import sqlite3
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

SECOND = 10**9
START_NS = 1_700_000_000 * SECOND
ROS1, HUMBLE = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


def scan(store: Typestore, time_ns: int, beams: int = 9) -> object:
    """A LaserScan of ROS 1 or ROS 2."""
    seq = {"seq": 7} if store is ROS1 else {}
    stamp = store.types["builtin_interfaces/msg/Time"](sec=time_ns // SECOND, nanosec=time_ns % SECOND)
    header = store.types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id="base_scan")
    ranges = np.linspace(1, 2, beams, dtype=np.float32)
    values = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 0.25, "time_increment": 0.0, "scan_time": 0.1}
    return store.types["sensor_msgs/msg/LaserScan"](
        header=header, **values, range_min=0.1, range_max=15.0, ranges=ranges, intensities=ranges[:0]
    )


def text(store: Typestore, words: str) -> object:
    """A std_msgs/String."""
    return store.types["std_msgs/msg/String"](data=words)


def times(count: int) -> list[int]:
    """Log times, ten per second."""
    return [START_NS + i * SECOND // 10 for i in range(count)]


def write_ros1(path: Path, count: int = 40, compression: str | None = None, chunk_bytes: int = 1000) -> Path:
    """A ROS 1 bag with `count` scans on /scan and as many texts on the latched /talk, in many chunks."""
    writer = Writer1(path)
    writer.chunk_threshold = chunk_bytes
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression.upper()])
    with writer:
        scans = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=ROS1)
        talk = writer.add_connection("//talk", "std_msgs/msg/String", typestore=ROS1, latching=1)
        for i, time_ns in enumerate(times(count)):
            writer.write(scans, time_ns, ROS1.serialize_ros1(scan(ROS1, time_ns), "sensor_msgs/msg/LaserScan"))
            writer.write(talk, time_ns + 1, ROS1.serialize_ros1(text(ROS1, f"word {i}"), "std_msgs/msg/String"))
    return path


def write_ros2(folder: Path, storage: str = "sqlite3", mode: str | None = None, count: int = 20) -> Path:
    """A ROS 2 bag with scans on /scan and texts on /talk; `mode` is `file` or `message` for zstd."""
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
    writer = Writer2(folder, version=9, storage_plugin=plugin)
    if mode:
        writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    with writer:
        scans = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=HUMBLE)
        talk = writer.add_connection("/talk", "std_msgs/msg/String", typestore=HUMBLE)
        for i, time_ns in enumerate(times(count)):
            writer.write(scans, time_ns, HUMBLE.serialize_cdr(scan(HUMBLE, time_ns), "sensor_msgs/msg/LaserScan"))
            writer.write(talk, time_ns + 1, HUMBLE.serialize_cdr(text(HUMBLE, f"word {i}"), "std_msgs/msg/String"))
    return folder


def write_plain_db3(
    path: Path, count: int = 20, *, index: bool = True, message_type: str = "std_msgs/msg/String"
) -> Path:
    """A db3 as humble writes it: without definitions. Rows are written against the order of time."""
    with sqlite3.connect(path) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,"
            " offered_qos_profiles TEXT);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        )
        if index:
            database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        database.execute("INSERT INTO topics VALUES (1, '/talk', ?, 'cdr', '- history: 3')", (message_type,))
        rows = [
            (time_ns, bytes(HUMBLE.serialize_cdr(text(HUMBLE, f"word {i}" * 20), "std_msgs/msg/String")))
            for i, time_ns in enumerate(times(count))
        ]
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)", rows[::-1])
    database.close()
    return path


def write_mrclam(folder: Path, **changes: str) -> Path:
    """A data set of robots 1 and 2 driving an arc past landmark 6; `changes` replace files by name without .dat."""
    stamps = [1_248_444_187.0 + i / 10 for i in range(50)]
    files = {
        "Barcodes": "# Subject Barcode\n1 5\n2 14\n6 63\n7 25\n",
        "Landmark_Groundtruth": "# Subject x y sd sd\n6 2.0 1.0 0.01 0.02\n7 3.0 -1.0 0.01 0.02\n",
        "Robot1_Odometry": "".join(f"{time:.3f} 0.1 0.2\n" for time in stamps),
        "Robot1_Measurement": "".join(f"{time:.3f} 63 2.0 0.5\n{time:.3f} 14 1.0 0.0\n" for time in stamps[::10]),
        "Robot1_Groundtruth": "".join(f"{time:.3f} 1.0 2.0 0.3\n" for time in stamps),
        "Robot2_Odometry": "".join(f"{time:.3f} 0.0 0.0\n" for time in stamps),
        "Robot2_Measurement": "".join(f"{time:.3f} 99 2.0 0.5\n" for time in stamps[::10]),
        "Robot2_Groundtruth": "".join(f"{time:.3f} 1.0 2.0 0.3\n" for time in stamps),
    }
    folder.mkdir()
    for name, content in (files | changes).items():
        (folder / f"{name}.dat").write_text(content)
    return folder
