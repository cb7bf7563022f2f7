"""How long stages took: what a verb printed with --json tells of a result, which itself holds no times of the clock."""

import json
from collections.abc import Mapping
from typing import Any

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, to_read

StageSeconds = Mapping[str, float]


def stage_seconds(printed: Location, result: Location) -> StageSeconds:
    """The seconds of each stage that ran for a result, by its name.

    Raises:
        UsageError: the file cannot be read, is no such document, or is of other results.
    """
    runs = _runs(printed)
    names = [str(run.get("output") or run.get("path") or "").rpartition("/")[2] for run in runs]
    of_result = [run for run, name in zip(runs, names, strict=True) if name == result.name]
    if len(runs) == 1 and "output" not in runs[0]:  # `map` tells the log that it read, and not what it wrote
        of_result = runs
    if len(of_result) != 1:
        of = ", ".join(names)
        raise UsageError(f"{printed}: is of {of}, and not of {result.name}; give what its own run printed")
    seconds = of_result[0]["seconds"]
    return {str(stage): float(value) for stage, value in seconds.items() if isinstance(value, int | float)}


def _runs(printed: Location) -> list[dict[str, Any]]:
    """The runs that a document is of, one per log, of those that tell seconds."""
    try:
        document = json.loads(to_read(printed).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(
            f"{printed}: cannot be read as JSON ({error}); give what a verb printed with --json"
        ) from error
    logs = document.get("logs", [document]) if isinstance(document, dict) else []
    runs = [run for run in logs if isinstance(run, dict) and isinstance(run.get("seconds"), dict)]
    if not runs:
        raise UsageError(f"{printed}: tells no seconds of stages; give what run, localize or map printed with --json")
    return runs
