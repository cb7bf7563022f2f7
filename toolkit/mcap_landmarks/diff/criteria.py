"""What a comparison of two sets of runs asks of each figure: built in, or as a TOML file says over it."""

import dataclasses
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeVar, get_args

from pydantic import Field, TypeAdapter, ValidationError

from mcap_landmarks.diff.tolerances import nearest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, to_read

Direction = Literal["lower", "higher", "one", "none"]
Consequence = Literal["pass", "fail"]
_Margin = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Criterion:
    """What is asked of a figure.

    margin: a change up to this is none that matters, relative (0.02 is 2 %) or, of shares and counts, absolute.
    direction: which way is better; `one` is of figures that are best at 1, `none` of those that are neither.
    gates: whether it takes part in the verdict over all. log_margin: by how much it may get worse in any one log, in
    the terms of `margin`. limit: what the candidate may not go beyond in any log, in the figure's own unit.
    """

    margin: _Margin
    direction: Direction
    gates: bool = False
    log_margin: _Margin | None = None
    limit: float | None = None


@dataclass(frozen=True, slots=True)
class Metric:
    """A figure of a log, and how its values of two runs are compared: by ratio, or by difference.

    least: values of a ratio that are smaller count as this: what lies below it is no accuracy that anybody needs.
    """

    criterion: Criterion
    relative: bool
    least: float = 0.0


def _ratio(margin: float, direction: Direction, least: float, *, gates: bool = False) -> Metric:
    return Metric(Criterion(margin, direction, gates), relative=True, least=least)


def _difference(margin: float, direction: Direction, *, gates: bool = False) -> Metric:
    return Metric(Criterion(margin, direction, gates), relative=False)


METRICS: dict[str, Metric] = {
    "localized_share": _difference(0.01, "higher", gates=True),
    "false.share": _difference(0.005, "lower", gates=True),
    "position.rmse_m": _ratio(0.02, "lower", 1e-4, gates=True),
    "heading.rmse_deg": _ratio(0.02, "lower", 1e-3, gates=True),
    "position.median_m": _ratio(0.02, "lower", 1e-4),
    "position.p95_m": _ratio(0.02, "lower", 1e-4),
    "position.within_0_2_m": _difference(0.01, "higher"),
    "rpe": _ratio(0.02, "lower", 1e-4),
    "nees": _ratio(0.1, "one", 1e-3),
    "map.rmse_aligned_m": _ratio(0.02, "lower", 1e-4),
    "map.missing": _difference(0.5, "lower"),
    "map.spurious": _difference(0.5, "lower"),
    "sigma_m": _ratio(0.02, "none", 1e-4),
    "residual_m": _ratio(0.02, "lower", 1e-4),
    "detections_per_image": _ratio(0.02, "none", 1e-2),
    "objects_per_scene": _ratio(0.02, "none", 1e-2),
    "bundles": _ratio(0.02, "none", 1.0),
    **{
        f"status.{name}": _difference(0.01, "none")
        for name in ("ambiguous", "too_few_objects", "no_match", "inconsistent", "weak_geometry")
    },
}
"""Every figure that is compared. The margins are what we ourselves would call no change: 2 % of an error or rate, which
is less than two logs of one place differ by, a hundredth of the bundles, half a landmark; the criteria file has others.
"""


@dataclass(frozen=True, slots=True)
class Criteria:
    """What decides: of the comparison as a whole, and of each figure by its name.

    confidence: of every verdict. inconclusive: what a gating figure without a verdict does. missing: what a log of the
    baseline does that the candidate lacks.
    """

    confidence: Annotated[float, Field(ge=0.5, lt=1)] = 0.95
    inconclusive: Consequence = "pass"
    missing: Consequence = "fail"
    metrics: Mapping[str, Criterion] = field(
        default_factory=lambda: {name: metric.criterion for name, metric in METRICS.items()}
    )


def read_criteria(path: Location) -> Criteria:
    """The criteria of a TOML file: keys of `Criteria`, and of `Criterion` in a table `[metrics.NAME]` for each figure.

    What it does not say stays as it is built in.

    Raises:
        UsageError: it cannot be read, has a key or a figure that does not exist, or a value does not fit.
    """
    try:
        tables = tomllib.loads(to_read(path).read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{path}: there is no such file of criteria; check the path") from error
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{path}: not a TOML file: {error}") from error
    known = [entry.name for entry in dataclasses.fields(Criteria)]
    for key in tables:
        if key not in known:
            raise UsageError(f"{path}: there is no criterion {key}{nearest(key, known)}")
    given = tables.get("metrics", {})
    if not isinstance(given, dict):
        raise UsageError(f"{path}: metrics = {given!r}: write a table for each, such as [metrics.position.rmse_m]")
    metrics = dict(Criteria().metrics)
    for name, keys in _by_metric(path, given).items():
        metrics[name] = _criterion(path, name, keys)
    return _validated(path, TypeAdapter(Criteria), {**tables, "metrics": metrics}, "")


def _by_metric(path: Location, table: Mapping[str, object], prefix: str = "") -> dict[str, dict[str, object]]:
    """The tables by the name of their figure, whose dots make tables within tables unless they are quoted."""
    found: dict[str, dict[str, object]] = {}
    for key, value in table.items():
        name = prefix + key
        if isinstance(value, dict) and name in METRICS:
            found[name] = value
        elif isinstance(value, dict) and any(metric.startswith(f"{name}.") for metric in METRICS):
            found.update(_by_metric(path, value, f"{name}."))
        elif name in METRICS:
            raise UsageError(f"{path}: metrics.{name} = {_written(value)}: give a table, such as {{ margin = 0.05 }}")
        else:
            raise UsageError(f"{path}: there is no figure {name} with criteria{nearest(name, METRICS)}")
    return found


def _criterion(path: Location, name: str, keys: Mapping[str, object]) -> Criterion:
    known = [entry.name for entry in dataclasses.fields(Criterion)]
    for key in keys:
        if key not in known:
            raise UsageError(f"{path}: metrics.{name} has no key {key}{nearest(key, known)}")
    built_in = METRICS[name].criterion
    made = _validated(path, TypeAdapter(Criterion), {**dataclasses.asdict(built_in), **keys}, f"metrics.{name}.")
    if made.limit is not None and made.direction in {"one", "none"}:
        raise UsageError(f"{path}: metrics.{name}.limit needs a direction, lower or higher, to be gone beyond")
    return made


def _validated(path: Location, adapter: TypeAdapter[_T], values: Mapping[str, object], prefix: str) -> _T:
    try:
        # As JSON, where strictness is of numbers, truths and texts alone: in Python it would refuse tables, too.
        return adapter.validate_json(json.dumps(values, default=_plain), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise UsageError(f"{path}: {prefix}{key} = {_written(first['input'])}: {_EXPECTED[key]}") from error


_EXPECTED = {
    "confidence": "give a number from 0.5 to below 1, such as 0.95",
    **dict.fromkeys(("inconclusive", "missing"), 'give "pass" or "fail"'),
    **dict.fromkeys(("margin", "log_margin"), "give a number above 0, such as 0.05"),
    "direction": f"give one of {', '.join(get_args(Direction))}",
    "gates": "give true or false",
    "limit": "give a number",
}
"""What each key takes, and so what to do where it has something else."""


def _written(value: object) -> str:
    """A value as TOML has it, as far as that differs."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _plain(value: object) -> object:
    """What TOML has and JSON has not: criteria that were checked before, and dates, which no criterion is."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    return str(value)
