"""The formats that a conversion writes: what their outputs are called, and what they cannot hold."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.inspection.open_logs import OpenLog
from mcap_landmarks.locations import Location
from mcap_landmarks.recording.chunk_form import ChunkForm
from mcap_landmarks.recording.writer import ROS2, profile_of
from mcap_landmarks.runs.outputs import BAGS, make_folder, names_folder
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.sources import ros1_type
from mcap_landmarks.stage import Connection


class OutputFormat(StrEnum):
    """What outputs are: recordings, bags of ROS 2, which are folders, or those of ROS 1."""

    MCAP = "mcap"
    ROSBAG2 = "rosbag2"
    BAG = "bag"


@dataclass(frozen=True, slots=True)
class OutputForm:
    """How outputs are written: in which format, in parts, with chunks of another form; into a folder if it is named so.

    Without `names_folder` an output is a file if it has the suffix of one.
    """

    split: Split | None = None
    chunks: ChunkForm | None = None
    to: OutputFormat = OutputFormat.MCAP
    names_folder: bool = False


_SUFFIXES = {OutputFormat.MCAP: ".mcap", OutputFormat.BAG: ".bag"}
_FILES = BAGS | {".mcap"}


def refusal(to: OutputFormat, connection: Connection) -> str:
    """Why a format cannot hold the messages of a connection, empty if it can."""
    if to is OutputFormat.MCAP:
        return ""
    if profile_of([connection]) != ROS2:
        return f"its messages are {connection.message_encoding or 'of no known encoding'}, and bags hold those of ROS"
    if to is OutputFormat.BAG:
        try:
            ros1_type(connection.message_type, connection.schema, connection.schema_encoding)
        except MessageError as error:
            return str(error)
    return ""


def planned(logs: Sequence[OpenLog], output: Location, form: OutputForm) -> dict[Location, list[OpenLog]]:
    """Which logs go into which output: all into one that is named, else each into one of its name in a folder.

    Raises:
        UsageError: the name is that of another format, or does not fit the logs.
    """
    _check_split(form)
    several, own = len(logs) > len({log.path for log in logs}), _SUFFIXES.get(form.to, "")
    if output.suffix.lower() in _FILES and not (form.names_folder or names_folder(output)):
        _check_file(output, form, len(logs) if several else 1)
        return {check_target(output): list(logs)}
    if isinstance(output, Path) and output.exists() and not output.is_dir():
        raise UsageError(
            f"{output} is a file and no folder; give the output another name" + f", as NAME{own}" * bool(own)
        )
    if form.to is OutputFormat.ROSBAG2 and not several:
        return {output: list(logs)}
    return _in_folder([f"{log.name}{own}" for log in logs], logs, output)


def _check_split(form: OutputForm) -> None:
    if form.split and form.to is OutputFormat.BAG:
        raise UsageError("--to bag writes each log as one file; split it with --to rosbag2, or as MCAP")


def _check_file(output: Location, form: OutputForm, logs: int) -> None:
    """Refuse the name of a file for what is of another format, or becomes several."""
    own = _SUFFIXES.get(form.to)
    if output.suffix.lower() != own:
        raise UsageError(f"{output}: {_remedy(output, form.to)}")
    if form.split:
        raise UsageError(f"{output}: a split makes several files; give -o a folder, without {own}")
    if logs > 1:
        raise UsageError(f"{output}: the input holds {logs} logs; give -o a folder, without {own}")


def _remedy(output: Location, to: OutputFormat) -> str:
    if to is OutputFormat.ROSBAG2:
        return f"a ROS 2 bag is a folder; name it {output.stem}"
    if to is OutputFormat.BAG:
        return f"--to bag writes ROS 1 bags; name the output {output.stem}.bag"
    other = "--to bag" if output.suffix == ".bag" else f"-o {output.stem} --to rosbag2"
    return f"convert writes MCAP; name the output {output.stem}.mcap, or make a bag with {other}"


def _in_folder(names: Collection[str], logs: Sequence[OpenLog], output: Location) -> dict[Location, list[OpenLog]]:
    """One output per log."""
    folder = make_folder(output)
    plan: dict[Location, list[OpenLog]] = {}
    for name, log in zip(names, logs, strict=True):
        if folder / name in plan:
            raise UsageError(f"{log.path}: another input also writes {folder / name}; convert it into another folder")
        plan[folder / name] = [log]
    return plan
