"""A task that has ended as a row of the catalogue: what its verb printed, and what its output's manifest tells."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from mcap_landmarks import __version__
from mcap_landmarks.catalogue.catalogue_columns import COLUMNS, Row, Value
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fleet.tasks import Ended
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, entry_text, text_hash, told
from mcap_landmarks.maps.database import read_manifest
from mcap_landmarks.recording.reader import open_recording

_STATUSES = ("localized", "ambiguous", "too_few_objects", "no_match", "inconsistent", "weak_geometry")
_FIGURES: dict[str, dict[str, tuple[str, ...]]] = {
    "convert": {"messages": ("read",), "lost": ("lost",)},
    "detect": {"images": ("images",), "detections": ("detections",)},
    "map": {"bundles": ("bundles",)},
    "localize": {"bundles": ("bundles",), **{name: ("statuses", name) for name in _STATUSES}},
    "evaluate": {
        "bundles": ("bundles",),
        **{name: ("statuses", name) for name in _STATUSES},
        "localized": ("localized",),
        "eligible": ("eligible",),
        "scored": ("scored",),
        "false_count": ("false", "count"),
        "false_share": ("false", "share"),
        **{name: ("position", name) for name in ("rmse_m", "median_m", "p95_m", "max_m", "within_0_2_m", "within_1_m")},
        "heading_rmse_deg": ("heading", "rmse_deg"),
        "heading_median_deg": ("heading", "median_deg"),
        "nees": ("nees",),
        "rpe_m": ("rpe",),
        "landmarks": ("map", "landmarks"),
        "map_matched": ("map", "matched"),
        "map_missing": ("map", "missing"),
        "map_spurious": ("map", "spurious"),
        "map_rmse_m": ("map", "rmse_m"),
    },
}
"""Where the document of a verb has the figures of a row."""
_DECIDING = ("verb", "config", "inputs", "resources", "options")
"""The entries of a manifest that say what was run on what; its stages have keys of their own."""


@dataclass(frozen=True, slots=True)
class Told:
    """What `batch` tells of a task that ended; `document` is what the verb printed, None if that is no JSON."""

    outcome: str
    document: object
    errors: Sequence[str]
    notes: Sequence[str]


def row_of(ended: Ended, told_of: Told, position: int, started: datetime) -> Row:
    """The row of a task, the one at `position` of its batch, which `started` then."""
    task, document = ended.task, told_of.document
    has_output = told_of.outcome != "failed" and task.verb != "map"  # the map of all logs is not there yet
    kept = None
    if has_output:
        kept = task.log if task.verb == "evaluate" else task.output
    return {
        "log": str(task.log),
        "output": str(task.output) if has_output else None,
        "verb": task.verb,
        "outcome": told_of.outcome,
        "started": started,
        "position": position,
        **_made_of(kept, task.log),
        **{name: _figure(name, document, path) for name, path in _FIGURES.get(task.verb, {}).items()},
        "seconds": round(ended.seconds, 3),
        **_stage_seconds(document),
        "peak_memory_bytes": ended.peak_bytes,
        "attempts": ended.attempts,
        "exit_code": ended.exit_code,
        "errors": "\n".join(told_of.errors) or None,
        "notes": "\n".join(told_of.notes) or None,
        "toolkit_version": __version__,
    }


def _made_of(kept: Location | None, log: Location) -> Row:
    """Fingerprint, key and settings, as the manifest of what was `kept` has them; of the log where there is none."""
    if kept is not None and kept.suffix == ".db":
        entries = read_manifest(kept)
        inputs: list[str] = told(entries.get("inputs"), [])
        fingerprint = inputs[0] if len(inputs) == 1 else None
    else:
        recorded, fingerprint = _recorded(kept or log)
        entries = dict(recorded) if kept is not None else {}
    return {"fingerprint": fingerprint, **_decided(entries)}


def shared_by_logs(database: Location, document: object) -> Row:
    """What the rows of all logs of one map have of it; `document` is what its verb printed."""
    counts = {name: _figure(name, document, (name,)) for name in ("landmarks", "tentative")}
    return {"output": str(database), **_decided(read_manifest(database)), **counts}


def _decided(entries: Mapping[str, str]) -> Row:
    """Key and settings of a run, as a manifest tells them."""
    stages: dict[str, dict[str, object]] = told(entries.get("stages"), {})
    deciding = {name: entries.get(name) for name in _DECIDING}
    deciding["stages"] = entry_text({name: stage.get("key") for name, stage in stages.items()})
    return {"run_key": text_hash(entry_text(deciding)) if entries else None, "settings": entries.get("config")}


def _recorded(place: Location) -> tuple[Mapping[str, str], str | None]:
    """The manifest and the fingerprint of a recording; nothing where it is none."""
    with contextlib.suppress(ToolkitError, OSError), open_recording(place) as recording:
        return recording.metadata.get(RUN, {}), recording.fingerprint()
    return {}, None


def _stage_seconds(document: object) -> Row:
    """The seconds of each stage that ran, by column."""
    found = _at(document, ("seconds",))
    seconds = found if isinstance(found, Mapping) else {}
    return {f"seconds_{stage}": float(value) for stage, value in sorted(seconds.items())}


def _figure(name: str, document: object, path: Sequence[str]) -> Value:
    value = _at(document, path)
    if not isinstance(value, (int, float)):
        return None
    return float(value) if COLUMNS[name] == "number" else int(value)


def _at(document: object, path: Sequence[str]) -> object:
    """What lies at a path of keys in JSON; None where there is nothing."""
    value = document
    for key in path:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
