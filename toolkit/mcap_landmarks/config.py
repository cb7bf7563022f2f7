"""The configuration of all stages: a TOML file, single settings, and what they mean for each stage."""

import contextlib
import dataclasses
import difflib
import json
import math
import re
import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location, to_read
from mcap_landmarks.sources import SOURCES, find_source, source_names
from mcap_landmarks.stage import Config, Stage
from mcap_landmarks.stages import STAGES, find_stage, stage_names, usable_stages

if TYPE_CHECKING:
    from pydantic import TypeAdapter

_C = TypeVar("_C", bound=Config)
Settings = dict[str, dict[str, object]]
"""What the user set: value by key, by stage or source. What is not set has the default of the dataclass."""


def gather(file: Location | None, settings: Sequence[str], method: str | None) -> Settings:
    """Settings by stage or source from a TOML file, then `STAGE.KEY=VALUE` texts over it.

    `method` counts for every stage.

    Raises:
        UsageError: the file or a setting cannot be read, or names what does not exist, or a value does not fit.
    """
    gathered: Settings = _from_file(file) if file else {}
    for text in settings:
        _merge(gathered, _from_text(text))
    for name, table in gathered.items():
        _known(name, (*stage_names(), *source_names()), "stage or source")
        made = declaration(name)
        stage_config(made.config, name, {key: value for key, value in table.items() if key not in made.files})
    if method is not None:
        for stage in usable_stages():
            if "method" in stage.config.__dataclass_fields__:  # packages' stages may have none
                gathered.setdefault(stage.name, {}).setdefault("method", method)
    return gathered


@dataclass(frozen=True, slots=True)
class Declaration:
    """What can be configured of a stage or source: its dataclass, and the files that it takes."""

    config: type[Config]
    files: tuple[str, ...] = ()


def declaration(name: str) -> Declaration:
    """The declaration of a stage or source by name.

    Raises:
        ExtensionError: the package that brings it cannot be used.
    """
    if name in source_names() and name not in STAGES.usable():
        return Declaration(find_source(name).config)
    stage = STAGES.own(name)
    return Declaration(stage.config, stage.files)


def usable_names() -> list[str]:
    """The names of all stages and sources; of packages' those that can be used."""
    return [*STAGES.usable(), *SOURCES.usable()]


def problems() -> list[str]:
    """What is wrong with packages that bring stages or sources, in words."""
    return [*STAGES.problems(), *SOURCES.problems()]


_TYPE_NAME = re.compile(r"[-\[]")
"""Of a value that may be of several types pydantic tells what each says, with the type's name behind the key."""
_WORDS = {"tuple_type": 'give a list, such as ["person", "suitcase"] or [0.1, 0.3]'}
"""What pydantic says in terms of Python, in terms of TOML."""


def _from_file(path: Location) -> Settings:
    try:
        tables = tomllib.loads(to_read(path).read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{path}: there is no such configuration file; check the path") from error
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{path}: not a TOML file: {error}") from error
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise UsageError(f"{path}: {name} stands outside a stage's table; write it below a line such as [localize]")
    return tables


def _from_text(text: str) -> Settings:
    """Settings of one text; a value that is no TOML is taken for a string."""
    name, equals, value = text.partition("=")
    for written in (value, json.dumps(value)):
        with contextlib.suppress(ValueError, RecursionError):
            tables = tomllib.loads(f"{name} = {written}")
            if equals and all(isinstance(table, dict) for table in tables.values()):
                return tables
    raise UsageError(f"--set {text}: write STAGE.KEY=VALUE, such as localize.max_sigma_m=0.3")


def _merge(into: Settings, other: Settings) -> None:
    for name, table in other.items():
        into[name] = _merged(into.get(name, {}), table)


def _merged(one: Mapping[str, object], other: Mapping[str, object]) -> dict[str, object]:
    """The keys of both; tables below are merged likewise, whatever else is in both is the other's."""
    merged = dict(one)
    for key, value in other.items():
        below = merged.get(key)
        merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def stage_config(config: type[_C], stage: str, settings: Mapping[str, object]) -> _C:
    """The configuration of one stage: its defaults with the settings over them.

    Raises:
        UsageError: an unknown key (the nearest known one is named) or a value that does not fit.
    """
    if not settings:
        return config()
    from pydantic import ValidationError  # noqa: PLC0415 - takes as long as to convert a small bag

    for key in settings:
        _known(key, [field.name for field in dataclasses.fields(config)], f"setting of {stage}")
    try:
        made: _C = _adapter(config).validate_python(dict(settings))
    except ValidationError as error:
        first, *others = error.errors()
        keys = [str(part) for part in first["loc"] if not _TYPE_NAME.search(str(part))]
        one_of_several = len(keys) < len(first["loc"])
        told = [first, *(other for other in others if one_of_several and other["loc"][:-1] == first["loc"][:-1])]
        words = " or ".join(_WORDS.get(one["type"], one["msg"]) for one in told)
        raise UsageError(f"{'.'.join([stage, *keys])} = {first['input']!r}: {words}") from error
    _all_taken(settings, effective(made), stage)
    return made


@cache
def _adapter(config: type[_C]) -> "TypeAdapter[_C]":
    """What checks a configuration; to make it takes 10 ms, as long as to look at a finished log."""
    from pydantic import TypeAdapter  # noqa: PLC0415 - see `stage_config`

    return TypeAdapter(config)


def _all_taken(given: object, made: object, where: str) -> None:
    """Refuse what is given below the first level and is nowhere in what was made of it, and what only passes for it."""
    if isinstance(given, Mapping) and isinstance(made, Mapping):
        for key, value in given.items():
            _known(key, made, f"setting of {where}")
            _all_taken(value, made[key], f"{where}.{key}")
    elif isinstance(given, list) and isinstance(made, list | tuple):
        for i, (one, other) in enumerate(zip(given, made, strict=False)):
            _all_taken(one, other, f"{where}.{i}")
    elif isinstance(made, bool | int | float):
        _check_kind(given, made, where)


def _check_kind(given: object, made: float, where: str) -> None:
    """Refuse a text or a truth in place of a number, a number in place of a truth, and what is no number."""
    is_truth = isinstance(made, bool)
    if isinstance(given, str) or isinstance(given, bool) != is_truth or math.isnan(made):
        raise UsageError(f"{where} = {given!r}: give {'true or false' if is_truth else 'a number'}")


def effective(config: Config) -> dict[str, object]:
    """Every key with its value, for the manifest."""
    return dataclasses.asdict(config)


@dataclass(frozen=True, slots=True)
class Files:
    """The files of a stage by name, and where those come from that were chosen."""

    paths: Mapping[str, Location]
    origins: Mapping[str, str]


def load_files(
    stage: Stage,
    settings: Settings,
    given: Mapping[str, Location | None],
    *,
    generated: bool = False,
    kept: Collection[str] = (),
) -> tuple[Config, Files]:
    """The configuration of a stage, and its files: `given` ones, else those that the settings name, such as
    `detect.model`, else what the stage chooses; `generated` says that the log is the generator's. Those that are `kept`
    are left out, unless they are given or named. Files are no part of the configuration, so that no path gets into a
    manifest.

    Raises:
        UsageError: a file that the stage cannot do without is not given, and none can be chosen.
    """
    own = dict(settings.get(stage.name, {}))
    files = {name: location(str(own.pop(name))) for name in stage.files if name in own}
    files.update({name: path for name, path in given.items() if path is not None and name in stage.files})
    kept = {*kept} - {*files}
    chosen = {name: choose(files.get(name), generated) for name, choose in stage.choices.items() if name not in kept}
    files.update({name: choice.path for name, choice in chosen.items()})
    _check_given(stage, {*files, *kept})
    origins = {name: choice.origin for name, choice in chosen.items()}
    return stage_config(stage.config, stage.name, own), Files(files, origins)


def _check_given(stage: Stage, names: Collection[str]) -> None:
    for name in stage.resources:
        if name not in names:
            raise UsageError(f"{stage.name} needs a {name}; give --{name} FILE or --set {stage.name}.{name}=FILE")


def named_files(settings: Settings) -> dict[str, Location]:
    """The files that settings name, such as `detect.model`, by the setting."""
    return {
        f"{name}.{key}": location(str(table[key]))
        for name, table in settings.items()
        for key in declaration(name).files
        if key in table
    }


def load(name: str, settings: Settings) -> Config:
    """The configuration of a stage by name."""
    return stage_config(find_stage(name).config, name, settings.get(name, {}))


def _known(name: str, names: Iterable[str], kind: str) -> None:
    known = sorted(names)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        raise UsageError(f"{name} is no {kind}; {hint}")
