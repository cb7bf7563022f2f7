"""The configuration as text: what is in force as TOML, and what can be written as a JSON schema."""

import json
import re
from collections.abc import Mapping

from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaValue

from mcap_landmarks.config import Settings, declaration, effective, stage_config, usable_names

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def everything(settings: Settings) -> dict[str, dict[str, object]]:
    """Every key of every stage and source that has any, with the value in force; None is unset."""
    found = {}
    for name in usable_names():
        made, given = declaration(name), settings.get(name, {})
        own = {key: value for key, value in given.items() if key not in made.files}
        files = {key: given.get(key) for key in made.files}
        table = {**effective(stage_config(made.config, name, own)), **files}
        if table:
            found[name] = table
    return found


def toml(tables: Mapping[str, Mapping[str, object]]) -> str:
    """Tables as TOML that reads back as they are; TOML has no null, so that what is unset is a comment."""
    lines: list[str] = []
    for name, table in tables.items():
        nested = {key: value for key, value in table.items() if isinstance(value, Mapping) and value}
        lines += ["", f"[{_key(name)}]"]
        for key, value in table.items():
            if value is None:
                lines.append(f"# {key} is unset")
            elif key not in nested:
                lines.append(f"{_key(key)} = {toml_value(value)}")
        for key, value in nested.items():
            lines += ["", f"[{_key(name)}.{_key(key)}]"]
            lines += [f"{_key(inner)} = {toml_value(one)}" for inner, one in value.items()]
    return "\n".join(lines[1:]) + "\n"


def _key(text: str) -> str:
    return text if _BARE.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def toml_value(value: object) -> str:
    """One value as TOML."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {toml_value(one)}" for key, one in value.items() if one is not None)
        return f"{{{inside}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(one) for one in value)}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return str(value).lower() if isinstance(value, bool) else repr(value)


def json_schema() -> JsonSchemaValue:
    """JSON schema of a configuration file."""
    made = {name: declaration(name) for name in usable_names()}
    adapters = [(name, "validation", TypeAdapter(entry.config)) for name, entry in made.items()]
    by_name, rest = TypeAdapter.json_schemas(adapters)  # type: ignore[arg-type] # a literal in a tuple
    definitions = {name: _closed(entry) for name, entry in sorted(rest.get("$defs", {}).items())}
    properties = {}
    for name, entry in made.items():
        found = by_name[name, "validation"]
        reference = found.get("$ref", "").rpartition("/")[2]
        table = definitions.pop(reference) if reference else _closed(found)
        files = {key: {"type": "string", "description": "Path of a file."} for key in entry.files}
        if table.get("properties") or files:
            properties[name] = {**table, "properties": {**table.get("properties", {}), **files}}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "mcap-landmarks/configuration/1",
        "title": "Configuration of mcap-landmarks: one table per stage or source",
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
        "$defs": definitions,
    }


def _closed(schema: JsonSchemaValue) -> JsonSchemaValue:
    """A dataclass's schema with no other keys, and its docstring on one line."""
    closed = {**schema, "additionalProperties": False} if "properties" in schema else schema
    if "description" in closed:
        closed = {**closed, "description": " ".join(closed["description"].split())}
    return closed
