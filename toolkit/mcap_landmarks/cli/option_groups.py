"""Options that verbs share, as dataclasses, and how a command takes them: typer knows single options only."""

import contextlib
import dataclasses
import functools
import inspect
from collections.abc import Callable
from inspect import Parameter
from typing import TYPE_CHECKING, get_args, get_type_hints

from typer.models import OptionInfo

from mcap_landmarks import memory
from mcap_landmarks.cli import options
from mcap_landmarks.locations import Location

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclasses.dataclass(frozen=True, slots=True)
class LogOptions:
    """What every verb takes that runs stages over logs."""

    config_file: options.ConfigFile = None
    settings: options.Set = None
    method: options.Method = None
    start: options.Start = None
    end: options.End = None
    remap: options.Remap = None
    time_offset: options.TimeOffset = None
    odom: options.OdometryTopic = None
    results_only: options.ResultsOnly = False
    force: options.Force = False
    overwrite: options.Overwrite = False
    json: options.Json = False


@dataclasses.dataclass(frozen=True, slots=True)
class ImageOptions:
    """What verbs take that look at images."""

    model: options.Model = None
    image: options.ImageTopics = None
    image_rate: options.ImageRate = None
    every: options.Every = None


@dataclasses.dataclass(frozen=True, slots=True)
class SegmentOptions:
    """What verbs take that may detect in one log with several processes."""

    segments: options.Segments = None
    workers: options.SegmentWorkers = None


@dataclasses.dataclass(frozen=True, slots=True)
class ScanOptions:
    """What verbs take that look at scans."""

    scan: options.ScanTopics = None
    scan_from: options.ScanFrom = None
    heights: options.Slice = None


def spread(command: Callable[..., None], *, reads: bool = False) -> Callable[..., None]:
    """The same command with every group of options among its parameters spread out, behind the command's own.

    One that `reads` files takes `--max-memory` as well.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: hint for name, hint in hints.items() if isinstance(hint, type) and dataclasses.is_dataclass(hint)}
    parameters = [
        parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name not in groups
    ]
    parameters += [single for group in groups.values() for single in _single(group)]
    if reads:
        bound = Parameter("max_memory", Parameter.KEYWORD_ONLY, default=None, annotation=options.MaxMemory)
        parameters = [parameter.replace(kind=Parameter.KEYWORD_ONLY) for parameter in parameters] + [bound]

    @functools.wraps(command)
    def taking(**given: object) -> None:
        if reads:
            size = given.pop("max_memory")
            memory.allow(None if size is None else str(size))
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in dataclasses.fields(group)})
        command(**given)

    for parameter in parameters:
        _name_value(parameter.annotation)
    taking.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    taking.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined] # inspect and typer look there
    return taking


_VALUES = {Location: "FILE", str: "TEXT", int: "N", float: "NUMBER", bool: ""}
"""What help says after an option that does not say it itself; of a flag typer would say `<bool>`, and it takes none."""


def _name_value(annotation: object) -> None:
    kind, *about = get_args(annotation) or (annotation,)
    while get_args(kind):  # `list[Location] | None`
        kind = get_args(kind)[0]
    for option in about:
        if isinstance(option, OptionInfo) and option.metavar is None and kind in _VALUES:
            option.metavar = _VALUES[kind]


def reading_logs(command: Callable[..., None]) -> Callable[..., None]:
    """The same command with --lenient, which then holds for every log that it reads."""

    @functools.wraps(command)
    def taking(*given: object, lenient: bool = False, **named: object) -> None:
        with contextlib.ExitStack() as stack:
            if lenient:
                from mcap_landmarks.recording.reader import reading_from_front

                stack.enter_context(reading_from_front())
            command(*given, **named)

    parameters = inspect.signature(command).parameters.values()
    lenient = Parameter("lenient", Parameter.KEYWORD_ONLY, default=False, annotation=options.Lenient)
    taking.__annotations__ = {**command.__annotations__, "lenient": options.Lenient}
    taking.__signature__ = inspect.Signature([*parameters, lenient])  # type: ignore[attr-defined] # as above
    return taking


def _single(group: "type[DataclassInstance]") -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name])
        for field in dataclasses.fields(group)
    ]
