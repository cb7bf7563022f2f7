"""What a worker is told of one segment of a log: where the log lies, from when to when, and what to do."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.locations import Location, Url, location
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.thinning import Thinning


@dataclass(frozen=True, slots=True)
class SegmentJob:
    """What makes one segment: a stage of a request, which has a record with this key, between two log times.

    `thinned` is how far `--every` and `--image-rate` have come when it begins.
    """

    request: Request
    stage: str
    key: str
    start_ns: int
    end_ns: int
    thinned: Mapping[str, Any] | None = None

    def text(self) -> str:
        """The job as JSON."""
        request, span = self.request, self.request.span
        asked = {
            "recording": _place(request.recording),
            "settings": request.settings,
            "files": {name: None if place is None else _place(place) for name, place in request.files.items()},
            "choice": asdict(span.choice),
            "span_ns": [span.start_ns, span.end_ns],
            "thinning": asdict(request.thinning),
            "use": request.use,
            "force": request.force,
        }
        own = {"stage": self.stage, "key": self.key, "bounds_ns": [self.start_ns, self.end_ns], "thinned": self.thinned}
        return json.dumps({**own, "request": asked}, default=str)


def job_of(text: str) -> SegmentJob:
    """The job of a text that `SegmentJob.text` made."""
    found: Mapping[str, Any] = json.loads(text)
    asked = found["request"]
    choice = Choice(**{**asked["choice"], "images": tuple(asked["choice"]["images"])})
    request = Request(
        location(asked["recording"]),
        asked["settings"],
        {name: None if place is None else location(place) for name, place in asked["files"].items()},
        Span(choice, *asked["span_ns"]),
        Thinning(**asked["thinning"]),
        tuple(asked["use"]),
        force=asked["force"],
    )
    start_ns, end_ns = found["bounds_ns"]
    return SegmentJob(request, found["stage"], found["key"], start_ns, end_ns, found["thinned"])


def _place(place: Location) -> str:
    """A place as `location` reads it."""
    return place.text if isinstance(place, Url) else str(place)
