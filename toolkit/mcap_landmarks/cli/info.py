"""Show what logs hold and which verbs can use them."""

import dataclasses
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, table, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import moment
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.inspection.info import LogInfo


@reading_logs
def command(
    paths: Annotated[
        list[Location], typer.Argument(metavar="PATH...", parser=location, help="Recordings (MCAP), bags or data sets.")
    ],
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Read everything, and tell what will go wrong and what to do; exit code 3 where something will.",
        ),
    ] = False,
    distro: options.Distro = None,
    definitions: options.Definitions = None,
    json: options.Json = False,
) -> None:
    """Show channels, times and roles of each PATH, and which verbs can use it or what they lack."""
    from mcap_landmarks.inspection.info import describe

    settings: dict[str, dict[str, object]] = {}
    options.add_definitions(settings, distro, definitions)
    logs = [log for path in paths for log in describe(path, settings, progress if check else None)]
    if json:
        documents = [_document(log) for log in logs]
        say_json("info", documents[0] if len(documents) == 1 else {"logs": documents})
    else:
        _print(logs)
    _tell(logs)
    if any(log.losses or log.left_out or log.problems for log in logs):
        raise typer.Exit(PARTIAL)


def _tell(logs: "Sequence[LogInfo]") -> None:
    for log in logs:
        for note in log.notes:
            warn(f"note: {note}")
        for topic in log.left_out:
            warn(f"warning: {log.path}: cannot be converted: {topic.told}")
        for loss in log.losses:
            warn(f"warning: {loss}")


def _document(log: "LogInfo") -> dict[str, object]:
    return {
        "path": str(log.path),
        "name": log.name,
        "profile": log.profile,
        "start_ns": log.start_ns,
        "end_ns": log.end_ns,
        "channels": [
            {
                "topic": channel.topic,
                "type": channel.message_type,
                "count": channel.count,
                "rate_hz": channel.rate_hz,
                "role": channel.role,
            }
            for channel in log.channels
        ],
        "roles": log.roles,
        "verbs": list(log.verbs),
        "missing": log.missing,
        "blocked": {verb: list(topics) for verb, topics in log.blocked.items()},
        "losses": list(log.losses),
        "notes": list(log.notes),
        "left_out": [topic.entries() for topic in log.left_out],
        **({} if log.findings is None else {"findings": [dataclasses.asdict(finding) for finding in log.findings]}),
        **({} if log.findings is None else {"network": log.network}),
    }


def _print(logs: "Sequence[LogInfo]") -> None:
    several = Counter(log.path for log in logs)
    for i, log in enumerate(logs):
        if i:
            say()
        say(f"{log.path}: {log.name}" if several[log.path] > 1 else str(log.path))
        _print_channels(log)
        _print_verbs(log)
        _print_findings(log)


def _print_channels(log: "LogInfo") -> None:
    count = sum(channel.count for channel in log.channels)
    profile = f"profile {log.profile}, " if log.profile else ""
    if log.start_ns is None or log.end_ns is None:
        say(f"{profile}no messages")
    else:
        duration = (log.end_ns - log.start_ns) * 1e-9
        say(f"{profile}{moment(log.start_ns)} to {moment(log.end_ns)}, {duration:.3f} s, {counted(count, 'message')}")
    rows = [
        [
            channel.topic,
            str(channel.count),
            "" if channel.rate_hz is None else f"{channel.rate_hz:.2f}",
            channel.message_type,
            channel.role or "",
        ]
        for channel in log.channels
    ]
    table(["topic", "messages", "Hz", "type", "role"], rows)


def _print_verbs(log: "LogInfo") -> None:
    if log.verbs:
        say(f"ready {'for' if log.is_recording else 'once converted, for'}: {', '.join(log.verbs)}")
    for verb, topics in log.blocked.items():
        say(f"{verb} fails, as said below of {', '.join(topics)}")
    for verb, roles in log.missing.items():
        lacks = [f"{role} ({log.hints[role]})" if role in log.hints else role for role in roles]
        say(f"{verb} lacks: {', '.join(lacks)}")


def _print_findings(log: "LogInfo") -> None:
    if log.network is not None:
        say(f"network for its images: {log.network}")
    for finding in log.findings or ():
        about = f"{finding.topic}: " if finding.topic else ""
        say(f"{finding.level}: {about}{finding.text}; {finding.remedy}")
    if log.findings == ():
        say("nothing was found that costs results")
