"""What a log holds: its channels, which roles they play, and which verbs can use it."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace

from mcap_landmarks.channels import MAP_POSE, MATCH, POSE, TRUTH_DETECTIONS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.config import Settings
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.inspection.checks import check
from mcap_landmarks.inspection.clock_reading import clocks_of
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.format_checks import check_formats, check_videos
from mcap_landmarks.inspection.mcap_log import McapLog
from mcap_landmarks.inspection.odometry_checks import examined_odometry
from mcap_landmarks.inspection.open_logs import OpenLog, open_logs
from mcap_landmarks.inspection.survey import survey
from mcap_landmarks.inspection.topic_roles import ROLES, Role, could_be, topics_for
from mcap_landmarks.locations import Location, is_folder
from mcap_landmarks.manifest import is_generated
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.networks.choice import choose_network
from mcap_landmarks.progress import Watch
from mcap_landmarks.recording.reader import Recording, open_recording, reading_from_front
from mcap_landmarks.sources import Log, OmittedTopic, together

TRUTH, RESULTS = "truth", "results"
_BY_TOPIC = {
    TRUTH: (TRUTH_POSE.topic, TRUTH_OBJECTS.topic, TRUTH_DETECTIONS.topic),
    RESULTS: (MATCH.topic, POSE.topic, MAP_POSE.topic),
}
_SOURCES = ("image", "camera_info", "scan")
NEEDS: Mapping[str, tuple[str, ...]] = {
    "detect": ("image",),
    "cluster": ("scan",),
    "map": ("scene_objects", "odometry"),
    "localize": ("scene_objects",),
    "evaluate": (RESULTS, TRUTH),
}
"""The roles that each verb cannot do without; scene objects can be made where there are `_SOURCES`."""

_CLOUDS = Role("point_cloud", "--scan-from", (PointCloud2,))
"""Clouds are scans only where the user says so."""


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A topic with one type: messages, their mean rate over the log (None below two), and the role it plays."""

    topic: str
    message_type: str
    count: int
    rate_hz: float | None
    role: str | None


@dataclass(frozen=True, slots=True)
class LogInfo:
    """One log. `name` tells the logs of one path apart, `roles` are topics by role, `missing` roles by verb.

    `blocked` are the verbs that have all roles and fail all the same, each with the topics of the problems. `left_out`
    are topics that `convert` cannot carry; some are known only when all was read. `hints` tells for roles that are
    missing which topics could play them, and how to choose one. `network` is the one that would look at its images,
    None where it has none or no network fits; it is told with the findings.
    """

    path: Location
    name: str
    profile: str
    start_ns: int | None
    end_ns: int | None
    channels: tuple[ChannelInfo, ...]
    roles: Mapping[str, list[str]]
    verbs: tuple[str, ...]
    missing: Mapping[str, list[str]]
    blocked: Mapping[str, tuple[str, ...]] = field(default_factory=dict, kw_only=True)
    hints: Mapping[str, str]
    losses: tuple[str, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    left_out: tuple[OmittedTopic, ...] = field(default=())
    findings: tuple[Finding, ...] | None = None
    network: str | None = None

    @property
    def problems(self) -> list[Finding]:
        """The findings that make a verb fail or give nothing."""
        return [finding for finding in self.findings or () if finding.level == "problem"]

    @property
    def is_recording(self) -> bool:
        """Whether it is a file that verbs read as it is; bags and data sets are converted first."""
        return self.path.suffix == ".mcap" and not is_folder(self.path)


def describe(place: Location, settings: Settings, watch: Watch | None = None) -> list[LogInfo]:
    """The logs at a place: a recording, a bag or a data set; with `watch` all of it is read, and checked.

    Raises:
        RecordingError: it cannot be read.
    """
    # A check reads everything, so no index needs to be trusted.
    with reading_from_front() if watch is not None else nullcontext(), open_logs(place, settings) as logs:
        described = []
        for log in logs:
            if watch is not None:
                log.verify(lambda _topic: True)
            first = log.only_file()
            if first is not None:
                with open_recording(log.path, known=first.index) as recording:  # also what cannot be converted
                    losses = [f"{log.path.name}: {loss}" for loss in recording.losses]
                    described.append(_describe(log, recording.profile, [recording], losses))
            else:
                losses = [*log.losses, *(loss for part in log.parts for loss in part.losses)]
                described.append(_describe(log, _profile(log), log.parts, losses))
            if watch is not None:
                described[-1] = _checked(log, described[-1], watch)
        return described


def _checked(log: OpenLog, info: LogInfo, watch: Watch) -> LogInfo:
    """What is known of a log when all of it was read: what is damaged, what will cost results, and which verbs fail."""
    with watch(f"check {log.name}", log.size_bytes) as progress:
        found = survey(log, info.roles, progress)
        found.clocks = clocks_of(log, info.roles, examined_odometry(found), found.log_frames())
    network, about_it = _network(log) if found.of("image") else (None, [])
    for part in log.parts:
        if isinstance(part, McapLog):
            part.check_attachments()
    findings = (*_about_formats(log, info), *about_it, *check(found))
    losses = dict.fromkeys([*info.losses, *(loss for part in log.parts for loss in part.losses)])
    blocked = _blocked(info, findings)
    verbs = tuple(verb for verb in info.verbs if verb not in blocked)
    return replace(info, findings=findings, network=network, losses=tuple(losses), verbs=verbs, blocked=blocked)


def _about_formats(log: OpenLog, info: LogInfo) -> Iterator[Finding]:
    for part in log.parts:
        yield from check_formats(part.recorded) if isinstance(part, McapLog) else ()
        yield from check_videos(info.roles["image"], part.channels)


def _blocked(info: LogInfo, findings: Sequence[Finding]) -> dict[str, tuple[str, ...]]:
    """The verbs that fail because of problems, with what these are about."""
    role_of = {topic: role for role, topics in info.roles.items() for topic in topics}
    found: dict[str, dict[str, None]] = {}
    for finding in (one for one in findings if one.level == "problem"):
        role = role_of.get(finding.topic, finding.check)
        for verb in info.verbs:
            if role in _uses(verb, info.roles):
                found.setdefault(verb, {})[finding.topic or finding.check] = None
    return {verb: tuple(topics) for verb, topics in found.items()}


def _uses(verb: str, roles: Mapping[str, Sequence[str]]) -> set[str]:
    """The roles, and kinds of problems, that a verb's results depend on."""
    if verb not in {"map", "localize"}:
        return {*NEEDS[verb], *({"network"} if verb == "detect" else ())}
    made = {"scene_objects"} if roles.get("scene_objects") else {*_SOURCES, "network"}
    return {*made, "frames", *({"odometry"} if verb == "map" else ())}


def _network(log: OpenLog) -> tuple[str | None, list[Finding]]:
    """The network that would look at a log's images, and what is wrong where there is none."""
    generated = all(isinstance(part, McapLog) and is_generated(part.metadata) for part in log.parts)
    try:
        return choose_network(None, generated).origin, []
    except ToolkitError as error:
        text, _, remedy = str(error).partition("; ")
        return None, [Finding("problem", "network", "", text, remedy)]


def _profile(log: OpenLog) -> str:
    profiles = {part.profile for part in log.parts if isinstance(part, McapLog)}
    if profiles:
        return min(profiles)
    return {"rosbag1": "ros1", "rosbag2": "ros2"}.get(log.source, "")


def _describe(log: OpenLog, profile: str, parts: Sequence[Log | Recording], losses: Sequence[str]) -> LogInfo:
    counts, left_out = _counts(parts), together(log.left_out)
    seconds = (log.end_ns - log.start_ns) * 1e-9 if log.start_ns is not None and log.end_ns is not None else 0.0
    read = {(one.connection.topic, one.connection.read_as) for part in parts for one in part.channels if one.count}
    roles = _roles(sorted(read))
    missing = _missing(roles)
    return LogInfo(
        log.path,
        log.name,
        profile,
        log.start_ns,
        log.end_ns,
        _channels(_counted(left_out) | counts, seconds, roles),
        {role: topics for role, topics in roles.items() if role != RESULTS},
        tuple(verb for verb, lacks in missing.items() if not lacks),
        {verb: lacks for verb, lacks in missing.items() if lacks},
        _hints(counts, roles),
        tuple(losses),
        log.all_notes(),
        tuple(left_out),
    )


def _counts(parts: Sequence[Log | Recording]) -> Counter[tuple[str, str]]:
    """The number of messages by topic and type."""
    counts: Counter[tuple[str, str]] = Counter()
    for part in parts:
        for entry in part.channels:
            counts[entry.connection.topic, entry.connection.message_type] += entry.count
    return counts


def _counted(left_out: Sequence[OmittedTopic]) -> Counter[tuple[str, str]]:
    counts: Counter[tuple[str, str]] = Counter()
    for one in left_out:
        counts[one.topic, one.message_type] += one.messages
    return counts


def _channels(
    counts: Mapping[tuple[str, str], int], seconds: float, roles: Mapping[str, Sequence[str]]
) -> tuple[ChannelInfo, ...]:
    role_of = {topic: role for role, topics in roles.items() for topic in topics}
    found = []
    for (topic, ros_type), count in sorted(counts.items()):
        rate_hz = count / seconds if seconds > 0 and count > 1 else None
        found.append(ChannelInfo(topic, ros_type, count, rate_hz, role_of.get(topic)))
    return tuple(found)


def _missing(roles: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """The roles that each verb lacks."""
    there = {role for role, topics in roles.items() if topics}
    if there.issuperset(_SOURCES):
        there.add("scene_objects")
    return {verb: [role for role in needs if role not in there] for verb, needs in NEEDS.items()}


def _hints(present: Collection[tuple[str, str]], roles: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """For each role that no topic plays, which ones a user could choose for it."""
    lacking = {role.name: could_be(present, channel) for channel, role in ROLES.items() if not roles.get(role.name)}
    return {role: hint for role, hint in lacking.items() if hint}


def _roles(present: Collection[tuple[str, str]]) -> dict[str, list[str]]:
    """Topics by role; truth and results go by their names, everything else by message type."""
    named = {topic for topics in _BY_TOPIC.values() for topic in topics}
    others = [(topic, ros_type) for topic, ros_type in present if topic not in named]
    roles = {role.name: topics_for(role, others) for role in ROLES.values() if role.messages}
    roles["point_cloud"] = topics_for(_CLOUDS, others)
    topics = {topic for topic, _ in present}
    return roles | {name: [topic for topic in known if topic in topics] for name, known in _BY_TOPIC.items()}
