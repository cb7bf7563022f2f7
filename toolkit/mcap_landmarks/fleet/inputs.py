"""Which logs a fleet has, as names, patterns, prefixes and manifests give them, and where their results go."""

import glob
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.fleet.fleet_manifest import ListedLog, read_fleet_manifest
from mcap_landmarks.inspection.open_logs import open_logs
from mcap_landmarks.locations import Location, Url, address, is_folder, is_there, location, matching, same_place

MANIFEST = ".toml"
"""What a manifest's name ends with."""


@dataclass(frozen=True, slots=True)
class FleetLog:
    """A log, the name of its output without suffix (None: its own), and what a manifest says of its options.

    `origins` says of each option where the manifest has it: file, table and key.
    """

    place: Location
    name: str | None = None
    options: Mapping[str, object] = field(default_factory=dict)
    origins: Mapping[str, str] = field(default_factory=dict)

    def key(self) -> tuple[str, str | None, str]:
        """Equal for what is the same log with the same options and output."""
        return address(self.place), self.name, repr(sorted(self.options.items()))


def find_logs(names: Iterable[str]) -> list[FleetLog]:
    """The logs that names, patterns (`**` is any depth), prefixes of URLs and manifests mean, each once: in the order
    in which they are named, then by name.

    Raises:
        UsageError: a pattern matches nothing, a manifest is none, or a URL cannot be listed.
    """
    found: dict[tuple[str, str | None, str], FleetLog] = {}
    for name in names:
        place = location(name)
        is_manifest = place.suffix == MANIFEST and (isinstance(place, Url) or is_there(place))
        for log in _of_manifest(place) if is_manifest else map(FleetLog, matching(place)):
            found.setdefault(log.key(), log)
    return list(found.values())


def _of_manifest(file: Location) -> list[FleetLog]:
    """The logs of a manifest."""
    return [
        FleetLog(_place(file, listed), listed.entry.name, listed.options, listed.origins)
        for listed in read_fleet_manifest(file)
    ]


def _place(file: Location, listed: ListedLog) -> Location:
    """Where a log of a manifest is; paths in it are meant from its folder.

    Raises:
        UsageError: the path is a pattern or a prefix of URLs, or of this machine and nothing is there.
        RemoteError: a URL without suffix, which might be a prefix, cannot be asked for.
    """
    path = listed.entry.path
    place = location(path)
    if isinstance(place, Path):
        place = file.parent / place if isinstance(file, Path) else file.with_name(path)
    is_local = isinstance(place, Path)
    if is_local and is_there(place):
        return place
    if glob.has_magic(path) if is_local else "*" in path:  # a URL's query begins with a question mark
        raise UsageError(f"{listed.where}: path = '{place}': patterns are for the command line; list each log")
    if is_local:
        raise UsageError(f"{listed.where}: path = '{place}': there is no such file; name it from the manifest's folder")
    if path.endswith("/") or (not place.suffix and is_folder(place)):
        raise UsageError(f"{listed.where}: path = '{place}': prefixes are for the command line; list each log")
    return place


def outputs_in(folder: Location, logs: Sequence[FleetLog], suffix: str) -> list[tuple[FleetLog, Location]]:
    """Each log with its output: the log's name with `suffix` in the folder. Earlier outputs there are no logs and are
    left out.

    A bag or data set that holds several logs, as one per robot, gets a folder of its own, without suffix.

    Raises:
        UsageError: two logs would write the same file, no log is left, or a target cannot be written.
    """
    outputs: list[tuple[FleetLog, Location]] = []
    taken: dict[str, Location] = {}
    for log in logs:
        if log.place.suffix == suffix and same_place(folder / log.place.name, log.place):
            continue
        own = log.place.name if isinstance(log.place, Path) and log.place.is_dir() else log.place.stem
        name = log.name or own
        target = folder / (name if _holds_several(log.place) else f"{name}{suffix}")
        if str(target) in taken:
            other = taken[str(target)]
            raise UsageError(f"{log.place}: {other} also writes {target}; rename one, or run them apart")
        if not (isinstance(target, Path) and target.is_dir()):
            check_target(target)
        outputs.append((log, target))
        taken[str(target)] = log.place
    if not outputs:
        raise UsageError(f"{folder}: all logs lie in the output folder; name another one with -o")
    return outputs


def _holds_several(place: Location) -> bool:
    if place.suffix == ".mcap" or not isinstance(place, Path):
        return False
    try:
        with open_logs(place, {}) as logs:
            return len(logs) > 1
    except ToolkitError:
        return False  # its own task says what is wrong with it
