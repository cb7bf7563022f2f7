"""Which stages have to run over a log before one can, and in what order."""

from collections.abc import Collection, Iterable, Sequence

from mcap_landmarks.channels import RESULTS, SHARED
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.inspection.format_checks import told_formats
from mcap_landmarks.inspection.topic_roles import ROLES, could_be
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.stage import Channel, Reduction, Stage
from mcap_landmarks.stages import find_stage, stage_names, usable_stages


def missing_stages(stage: Stage | Reduction, log: RecordedLog, use: Collection[str] = ()) -> list[str]:
    """The stages that have to come before one, in order: those whose results the log does not have as its own.

    Of several that write the same channel it is the one in `use`, else the one whose results lie in the log, else the
    only one whose own sources the log has. Results of ours in a log that lacks what they were made from are taken as
    they are.

    Raises:
        RecordingError: something that the stage needs is not there and cannot be made.
        UsageError: several stages could make it, or `use` names what is no stage.
    """
    names: list[str] = []
    for channel in stage.reads:
        if channel.topic.startswith(RESULTS) and channel not in stage.optional and not log.has(channel):
            names += [name for name in _chain_for(channel, log, use) if name not in names]
    return names


def _chain_for(channel: Channel[Message], log: RecordedLog, use: Collection[str]) -> list[str]:
    """The stages up to the one that writes a channel and that one itself; none where its results stay as they are."""
    producers = _producers(channel, use)
    present = [stage for stage in producers if stage.name in log.results]
    chains: dict[str, list[str]] = {}
    lacking: list[Channel[Message]] = []
    for producer in present or producers:
        try:
            chains[producer.name] = _chain_to(producer, log, use) if log.own.channels or not present else []
        except _LackingError as error:
            if present:
                chains[producer.name] = []
            lacking += error.sources
    if not chains:
        raise _LackingError(log, channel, lacking)
    if len(chains) > 1:
        raise UsageError(f"{log.path}: {' and '.join(chains)} can make {_name(channel)}; choose one with --use NAME")
    return next(iter(chains.values()))


def _producers(channel: Channel[Message], use: Collection[str]) -> list[Stage]:
    """The stages that write a channel, only those in `use` if there are any."""
    asked = [_stage(name) for name in use]
    found = [stage for stage in usable_stages() if isinstance(stage, Stage) and channel in stage.writes]
    if not found:
        raise UsageError(f"{channel.topic}: no stage writes it; read another topic as it with --remap")
    return [stage for stage in found if stage in asked] or found


class _LackingError(RecordingError):
    """A log has neither a channel nor any of the sources that it could be made from."""

    def __init__(self, log: RecordedLog, channel: Channel[Message], sources: Sequence[Channel[Message]]) -> None:
        first, own = sources[0], log.without_results()
        remedy = (
            f"choose topics with --remap or {ROLES[first].option if first in ROLES else '--remap'}, or take a log "
            "that has one of them"
        )
        present = [(entry.connection.topic, entry.connection.message_type) for entry in own.channels]
        hints = [hint for source in sources if (hint := could_be(present, source))]
        formats = told_formats(own.channels)
        told = filter(None, (formats or "; ".join(hints), own.told_damage()))
        super().__init__(
            f"{log.path}: there is no {_name(channel)}, and no {' or '.join(map(_name, sources))} to make it from; "
            f"{'; '.join(told) or remedy}"
        )
        self.sources = sources


def _chain_to(producer: Stage, log: RecordedLog, use: Collection[str]) -> list[str]:
    """The missing stages up to one and that one itself."""
    chain, primary = [*missing_stages(producer, log, use), producer.name], producer.reads[0]
    if not primary.topic.startswith(RESULTS) and not log.has(primary):
        raise _LackingError(log, primary, [primary])
    return chain


def _name(channel: Channel[Message]) -> str:
    role = ROLES.get(channel)
    return f"{role.name} ({' or '.join(role.types)})" if role else channel.topic


def in_order(names: Iterable[str]) -> list[str]:
    """Stages by name, each after those whose results it reads.

    Raises:
        UsageError: there is no such stage, it is not one that runs over a single log, or two write the same channel.
    """
    stages = {name: _stage(name) for name in names}
    _check_one_writer(list(stages.values()))
    ordered: list[str] = []
    while len(ordered) < len(stages):
        waiting = [stage for name, stage in stages.items() if name not in ordered]
        free = [stage for stage in waiting if not any(_reads(stage, other) for other in waiting if other is not stage)]
        ordered += sorted(stage.name for stage in free)
    return ordered


def _stage(name: str) -> Stage:
    if name not in stage_names():
        raise UsageError(f"{name} is no stage; there are {', '.join(stage_names())}")
    stage = find_stage(name)
    if not isinstance(stage, Stage):
        raise UsageError(f"{name} makes one result of many logs; use the verb that it belongs to")
    return stage


def _check_one_writer(stages: Sequence[Stage]) -> None:
    writers: dict[str, str] = {}
    for stage in stages:
        for topic in {channel.topic for channel in stage.writes} - SHARED:
            if topic in writers:
                raise UsageError(f"{writers[topic]} and {stage.name} both write {topic}; name one of them")
            writers[topic] = stage.name


def _reads(stage: Stage, other: Stage) -> bool:
    return any(channel in other.writes for channel in stage.reads if channel.topic.startswith(RESULTS))
