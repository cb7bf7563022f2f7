"""Scenarios from TOML files: what they extend, what the command line sets, and errors that name the line."""

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcap_landmarks.errors import ToolkitError, UsageError
from pydantic import ValidationError

from mcap_landmarks_generator.bundled import FOLDER, bundled
from mcap_landmarks_generator.scenario import ADAPTER, Scenario, json_schema
from mcap_landmarks_generator.toml_lines import KeyPath, lines_of


@dataclass(frozen=True, slots=True)
class LoadedScenario:
    """A scenario, and where each of its values was written."""

    name: str
    scenario: Scenario
    origins: Mapping[KeyPath, str]

    def fault(self, key_path: KeyPath, problem: str) -> ToolkitError:
        """The error that says where the value at `key_path` was written and what is wrong with it."""
        return ToolkitError(f"{_origin(self.origins, self.name, key_path)}: {problem}")

    def with_world(self, file: str, count: int) -> "LoadedScenario":
        """The scenario whose objects are the first `count` that the file of a world has, not those written in TOML."""
        kept = {key_path: origin for key_path, origin in self.origins.items() if key_path[0] != "objects"}
        return replace(self, origins={**kept, **{("objects", i): file for i in range(count)}})


def load_scenario(name: str, settings: Sequence[str] = (), seed: int | None = None) -> LoadedScenario:
    """The scenario of a bundled name or a TOML file, with `KEY=VALUE` settings such as `camera.rate_hz=5` over it.

    Raises:
        UsageError: there is no such scenario, or a setting cannot be read.
        ToolkitError: the scenario is wrong; the message names file and line.
    """
    path = _path(name, Path())
    content, origins = _read(path, ())
    for text in settings:
        _set(content, origins, text)
    try:
        scenario = ADAPTER.validate_python(content)
    except ValidationError as error:
        raise _first_fault(error, origins, path) from error
    return LoadedScenario(path.stem, scenario if seed is None else replace(scenario, seed=seed), origins)


def effective(scenario: Scenario) -> dict[str, object]:
    """Every value of a scenario under its name in TOML: the scenario made from these is the same."""
    content: dict[str, object] = ADAPTER.dump_python(scenario, mode="json", by_alias=True, exclude_none=True)
    return content


def _path(name: str, beside: Path) -> Path:
    """The file of a bundled scenario or of a path, which is meant relative to the folder `beside`."""
    path = FOLDER / f"{name}.toml" if "/" not in name and not name.endswith(".toml") else beside / name
    if path.is_file():
        return path
    names = sorted(bundled())
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]}?" if near else f"bundled are {', '.join(names)}"
    raise UsageError(f"{name}: there is no such scenario file, and none of that name is bundled; {hint}")


def _read(path: Path, above: tuple[Path, ...]) -> tuple[dict[str, object], dict[KeyPath, str]]:
    """Content of a file over that of the one it extends, and the origin `file:line` of each value."""
    try:
        text = path.read_text()
        content = tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise ToolkitError(f"{path}: not a TOML file: {error}") from error
    origins = {key_path: f"{path}:{line}" for key_path, line in lines_of(text).items()}
    world = content.get("world")
    if isinstance(world, dict) and isinstance(world.get("file"), str):
        world["file"] = str(path.parent / world["file"])
    base_name = content.pop("extends", None)
    if base_name is None:
        return content, origins
    if not isinstance(base_name, str):
        raise ToolkitError(f"{origins['extends',]}: extends must be the name of a scenario or a file")
    base_path = _path(base_name, path.parent)
    if base_path in (path, *above):
        raise ToolkitError(f"{origins['extends',]}: {base_name} extends this file in turn; remove one of the two lines")
    base, base_origins = _read(base_path, (path, *above))
    return _merge(base, base_origins, content, origins, ()), base_origins


def _merge(
    base: dict[str, object],
    base_origins: dict[KeyPath, str],
    content: Mapping[str, object],
    origins: Mapping[KeyPath, str],
    inside: KeyPath,
) -> dict[str, object]:
    """`base` with `content` over it: tables are joined, all else is replaced; the origins in place."""
    for key, value in content.items():
        key_path = (*inside, key)
        below = base.get(key)
        if isinstance(value, dict) and isinstance(below, dict):
            _merge(below, base_origins, value, origins, key_path)
            continue
        base[key] = value
        for old in [place for place in base_origins if place[: len(key_path)] == key_path]:
            del base_origins[old]
        base_origins.update({k: v for k, v in origins.items() if k[: len(key_path)] == key_path})
    return base


def _set(content: dict[str, object], origins: dict[KeyPath, str], text: str) -> None:
    name, equals, value = text.partition("=")
    keys = name.split(".")
    if not equals or not all(keys):
        raise UsageError(f"--set {text}: write KEY=VALUE, such as camera.rate_hz=5")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except (ValueError, RecursionError):
        parsed = value
    change: dict[str, object] = {keys[-1]: parsed}
    for key in reversed(keys[:-1]):
        change = {key: change}
    _merge(content, origins, change, {tuple(keys): f"--set {text}"}, ())


def _first_fault(error: ValidationError, origins: Mapping[KeyPath, str], path: Path) -> ToolkitError:
    first = error.errors(include_url=False)[0]
    key_path: KeyPath = tuple(first["loc"])
    if first["type"] == "unexpected_keyword_argument":
        known = _keys_of(key_path[:-1])
        near = difflib.get_close_matches(str(key_path[-1]), known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        problem = f"unknown key {key_path[-1]}; {hint}"
    elif first["type"] == "missing":
        problem = f"the key {key_path[-1]} is missing"
    else:
        message = first["msg"].removeprefix("Value error, ").removeprefix("Input ")
        problem = f"{'.'.join(str(part) for part in key_path)} = {first['input']!r}: {message}"
    origin = _origin(origins, str(path), key_path)
    return UsageError(f"{origin}: {problem}") if origin.startswith("--set") else ToolkitError(f"{origin}: {problem}")


def _keys_of(table: KeyPath) -> list[str]:
    """The keys that a table of a scenario can have, as its JSON schema lists them."""
    root: dict[str, Any] = json_schema()
    node = root
    for part in table:
        node = node["items"] if isinstance(part, int) else node["properties"][part]
        node = next((one for one in node.get("anyOf", ()) if "$ref" in one), node)  # one that may be left out
        if "$ref" in node:
            node = root["$defs"][node["$ref"].rpartition("/")[2]]
    return sorted(node["properties"])


def _origin(origins: Mapping[KeyPath, str], default: str, key_path: KeyPath) -> str:
    """Origin of the innermost known place around a key path."""
    for length in range(len(key_path), 0, -1):
        if key_path[:length] in origins:
            return origins[key_path[:length]]
    return default
