"""The configuration of all stages: a TOML file, single settings, and what they mean for each stage."""

import contextlib
import dataclasses
import difflib
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from toolkit.errors import ToolkitError, UsageError
from toolkit.resources import detector
from toolkit.sources import source_names
from toolkit.stage import Stage
from toolkit.stages import find_stage, stage_names

Settings = dict[str, dict[str, Any]]


def gather(file: Path | None, settings: Sequence[str], method: str | None) -> Settings:
    """Settings by stage or source from a TOML file, then `STAGE.KEY=VALUE` texts over it.

    `method` counts for every stage.

    Raises:
        UsageError: the file or a setting cannot be read, or names a stage that does not exist.
    """
    gathered: Settings = _from_file(file) if file else {}
    for text in settings:
        name, equals, value = text.partition("=")
        stage, dot, key = name.partition(".")
        if not (equals and dot and stage and key):
            raise UsageError(f"--set {text}: write STAGE.KEY=VALUE, such as localize.max_sigma_m=0.3")
        gathered.setdefault(stage, {})[key] = _value(value)
    for stage in gathered:
        _known(stage, (*stage_names(), *source_names()), "stage or source")
    if method is not None:
        for stage in stage_names():
            gathered.setdefault(stage, {}).setdefault("method", method)
    return gathered


def _from_file(path: Path) -> Settings:
    try:
        tables = tomllib.loads(path.read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{path}: there is no such configuration file") from error
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: not a TOML file: {error}") from error
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise UsageError(f"{path}: {name} stands outside a stage's table; write it below a line such as [localize]")
    return tables


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def stage_config(config: type[Any], stage: str, settings: Mapping[str, Any]) -> Any:
    """The configuration of one stage: its defaults with the settings over them.

    Raises:
        UsageError: an unknown key (the nearest known one is named) or a value that does not fit.
    """
    keys = [field.name for field in dataclasses.fields(config)]
    for key in settings:
        _known(key, keys, f"setting of {stage}")
    try:
        return TypeAdapter(config).validate_python(dict(settings))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join([stage, *(str(part) for part in first["loc"])])
        raise UsageError(f"{where} = {first['input']!r}: {first['msg']}") from error


def effective(config: Any) -> dict[str, Any]:
    """Every key with its value, for the manifest."""
    return dataclasses.asdict(config)


def load_files(stage: Stage, settings: Settings, given: Mapping[str, Path | None]) -> tuple[Any, dict[str, Path]]:
    """The configuration of a stage, and its files: `given` ones, else those that the settings name, such as
    `detect.model`. Files are no part of the configuration, so that no path gets into a manifest.

    Raises:
        UsageError: a file that the stage cannot do without is not given.
    """
    own, kinds = dict(settings.get(stage.name, {})), (*stage.resources, *stage.options)
    files = {name: Path(str(own.pop(name))) for name in kinds if name in own}
    files.update({name: path for name, path in given.items() if path is not None and name in kinds})
    for name in stage.resources:
        if name not in files:
            files[name] = _bundled(stage.name, name)
    return stage_config(stage.config, stage.name, own), files


def _bundled(stage: str, name: str) -> Path:
    """The file that travels with the program, where the user gives none."""
    if (stage, name) == ("detect", "model"):
        with contextlib.suppress(ToolkitError):
            return detector()
    raise UsageError(f"{stage} needs a {name} and none is bundled; give --{name} FILE or --set {stage}.{name}=FILE")


def load(name: str, settings: Settings) -> Any:
    """The configuration of a stage by name."""
    return stage_config(find_stage(name).config, name, settings.get(name, {}))


def _known(name: str, names: Iterable[str], kind: str) -> None:
    known = sorted(names)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        raise UsageError(f"{name} is no {kind}; {hint}")
