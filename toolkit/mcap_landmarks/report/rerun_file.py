"""A recording of Rerun on its way into a file: rows of entities on the timelines of the log, and what always holds."""

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.map_markers import class_color

LOG_TIME, STAMP = "log_time", "stamp"
"""The timelines: MCAP's log time, and the stamp in the message's header."""
_APPLICATION = "mcap-landmarks"


class RerunFile:
    """Writes rows; `rows` counts those of every entity, what always holds as one. Made by `create_rerun_file`."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self.rows: dict[str, int] = {}
        self._stream = stream
        self._classes: dict[str, int] = {}

    def add(
        self, entity: str, log_ns: Sequence[int], stamps_ns: Sequence[int], columns: rr.ComponentColumnList
    ) -> None:
        """Add rows to an entity, each with its log time and its stamp."""
        indexes = [_timeline(LOG_TIME, log_ns), _timeline(STAMP, stamps_ns)]
        rr.send_columns(entity, indexes, columns, recording=self._stream, strict=True)
        self.rows[entity] = self.rows.get(entity, 0) + len(log_ns)

    def always(self, entity: str, *what: rr.AsComponents) -> None:
        """Say what holds of an entity at all times."""
        for one in what:
            self._stream.log(entity, one, static=True, strict=True)
        self.rows[entity] = self.rows.get(entity, 0) + 1

    def class_ids(self, names: Iterable[str]) -> list[int]:
        """Numbers that stand for classes; 0 is that without a name."""
        return [self._classes.setdefault(name, len(self._classes) + 1) if name else 0 for name in names]

    def name_classes(self) -> None:
        """Say what the numbers of all classes stand for, in the colours that maps have in other viewers."""
        infos = [
            rr.AnnotationInfo(number, name, [round(255 * share) for share in class_color(name)])
            for name, number in self._classes.items()
        ]
        self.always("/", rr.AnnotationContext(infos))


@contextlib.contextmanager
def create_rerun_file(path: Path, identity: str, blueprint: rrb.Blueprint) -> Iterator[RerunFile]:
    """Give what writes a recording to `path`; `identity` is its id, so that opening it twice shows it once."""
    stream = rr.RecordingStream(_APPLICATION, recording_id=identity, send_properties=False)
    stream.save(path, default_blueprint=blueprint)
    try:
        yield RerunFile(stream)
    finally:
        stream.flush()
        stream.disconnect()


def _timeline(name: str, times_ns: Sequence[int]) -> rr.TimeColumn:
    return rr.TimeColumn(name, timestamp=np.array(times_ns, dtype="datetime64[ns]"))


def level(points_xy: Array) -> Array:
    """Points (N, 2) of the plane in space (N, 3)."""
    return np.column_stack([points_xy, np.zeros(len(points_xy))])


def transform(dst_from_src: Array) -> rr.Transform3D:
    """A rigid transform (4, 4)."""
    return rr.Transform3D(translation=dst_from_src[:3, 3], mat3x3=dst_from_src[:3, :3])
