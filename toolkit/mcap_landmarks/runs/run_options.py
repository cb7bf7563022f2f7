"""What can be asked of all logs of a run, by whom ever: the options of the verbs, before they are understood."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from mcap_landmarks.config import gather
from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.cameras import ALL
from mcap_landmarks.inspection.time_offsets import parse_offsets
from mcap_landmarks.inspection.topic_roles import Choice, parse_remaps
from mcap_landmarks.locations import Location
from mcap_landmarks.moments import time_ns
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.thinning import parse_thinning


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options by name, their texts as the command line takes them.

    `files` are the files that stages take, by resource name. `use` names the stages to use where several could make
    what a log lacks.
    """

    config_file: Location | None = None
    settings: Sequence[str] = ()
    method: str | None = None
    start: str | None = None
    end: str | None = None
    remap: Sequence[str] = ()
    time_offset: Sequence[str] = ()
    odom: str | None = None
    image: Sequence[str] = ()
    image_rate: float | None = None
    every: str | None = None
    scan: Sequence[str] = ()
    scan_from: str | None = None
    heights: str | None = None
    files: Mapping[str, Location | None] = field(default_factory=dict)
    use: Sequence[str] = ()
    results_only: bool = False
    force: bool = False
    overwrite: bool = False

    def requests(self, logs: Sequence[Location]) -> list[Request]:
        """What to do with each log.

        Raises:
            UsageError: there is no log, an option cannot be read, or a setting is wrong.
        """
        if not logs:
            raise UsageError("no log is named; name at least one")
        settings = gather(self.config_file, [*self.settings, *_slice(self.heights)], self.method)
        first = Request(
            logs[0],
            settings,
            self.files,
            self._span(),
            parse_thinning(self.image_rate, self.every),
            tuple(self.use),
            results_only=self.results_only,
            force=self.force,
            overwrite=self.overwrite,
            config_file=self.config_file,
        )
        return [replace(first, recording=log) for log in logs]

    def _span(self) -> Span:
        scans = dict(zip(("scan", "second_scan"), self._scans(), strict=False))
        one, several = self._images()
        topics = {"odometry": self.odom, "image": one, **scans}
        known = {role: topic for role, topic in topics.items() if topic}
        choice = Choice(known, parse_remaps(self.remap), several, parse_offsets(self.time_offset))
        return Span(choice, time_ns(self.start, "--start"), time_ns(self.end, "--end"))

    def _images(self) -> tuple[str | None, tuple[str, ...]]:
        """The topic of the one camera, and those of several; `all` is of several."""
        given = tuple(dict.fromkeys(self.image))
        if ALL in given and len(given) > 1:
            raise UsageError(f"--image {ALL} takes every camera that has a CameraInfo; give it alone, or name topics")
        return (given[0], ()) if len(given) == 1 and given != (ALL,) else (None, given)

    def _scans(self) -> Sequence[str]:
        """The topics to read scans from: one of clouds, or up to two to merge."""
        if self.scan and self.scan_from:
            raise UsageError("--scan-from takes the place of --scan; to merge a scan and a cloud give both with --scan")
        if len(self.scan) > 2:
            raise UsageError(f"--scan {' '.join(self.scan)}: two are the most that are merged")
        return [self.scan_from] if self.scan_from else self.scan


def _slice(heights: str | None) -> list[str]:
    """The setting that a slice of a point cloud stands for."""
    if heights is None:
        return []
    low, colon, high = heights.partition(":")
    try:
        slice_m = (float(low), float(high)) if colon else (0.0, 0.0)
    except ValueError:
        slice_m = (0.0, 0.0)
    if not slice_m[0] < slice_m[1]:
        raise UsageError(f"--slice {heights}: give two heights in metres, the lower one first, such as 0.1:0.3")
    return [f"cluster.slice_m=[{slice_m[0]}, {slice_m[1]}]"]
