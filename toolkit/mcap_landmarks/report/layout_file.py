"""The layout of a log for Foxglove and Lichtblick, read from a file, with what it names."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.foxglove_layout import layout
from mcap_landmarks.report.viewed_log import ViewedLog

_TOPIC = re.compile(r"[^.\[]*")
"""The topic that a message path begins with."""


@dataclass(frozen=True, slots=True)
class LayoutFile:
    """A layout as it goes into a file, its panels and topics, what is left out of the 3D panel, and what was lost."""

    document: Mapping[str, object]
    panels: tuple[str, ...]
    topics: tuple[str, ...]
    left_out: Mapping[str, str]
    losses: tuple[str, ...]


def read_layout(path: Location, progress: Progress) -> LayoutFile:
    """The layout for a log.

    Raises:
        RecordingError: it cannot be read, or has nothing that a panel shows.
    """
    result, _, losses = read_run(path, progress)
    with open_recording(path) as recording:
        document, left_out = layout(ViewedLog(recording), result)
    panels = document["configById"]
    assert isinstance(panels, dict)  # noqa: S101 - as it was made
    topics = tuple(sorted({*_topics(panels)}))
    if not topics:
        raise RecordingError(f"{path}: has nothing that Foxglove shows; run localize or map first")
    return LayoutFile(document, tuple(panels), topics, left_out, tuple(losses))


def _topics(panels: Mapping[str, Mapping[str, object]]) -> Iterator[str]:
    """Every topic that panels name."""
    for panel in panels.values():
        topics, mode, paths = (panel.get(name) or {} for name in ("topics", "imageMode", "paths"))
        yield from topics if isinstance(topics, dict) else ()
        if isinstance(mode, dict):
            yield from (mode[name] for name in ("imageTopic", "calibrationTopic") if name in mode)
            yield from mode.get("annotations", ())
        for path in paths if isinstance(paths, list) else ():
            found = _TOPIC.match(path["value"])
            yield found[0] if found else ""
