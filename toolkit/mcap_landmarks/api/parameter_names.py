"""Errors that name options of the command line, in terms of the parameters that stand for them in Python."""

import contextlib
import re
from collections.abc import Iterator, Mapping
from functools import partial

from mcap_landmarks.errors import ToolkitError

_TRUTHS = ("align", "fixed", "force", "lenient", "overwrite", "results-only")
_PAIRS = {"set": "settings", "remap": "remap", "time-offset": "time_offset", "tolerance": "tolerance"}
"""Options that take KEY=VALUE, and the parameters that take a dict of them."""
_VALUES = (
    "association", "child", "config", "criteria", "end", "every", "extrinsics", "fail-on", "image", "image-rate",
    "max-gap", "method", "model", "names", "odom", "prior", "reference", "scan", "scan-from", "start", "topic", "use",
)  # fmt: skip
_OTHER_NAMES = {"map": "map_file", "slice": "heights"}
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: ([A-Z][A-Z.:_]*(?:\.onnx)?\b))?")
_PAIR = re.compile(rf"--({'|'.join(_PAIRS)}) ([^\s=]+)=([^\s,;)]*[^\s,;):])")


def reworded(text: str, others: Mapping[str, str] | None = None) -> str:
    """A message with parameters in place of options, `others` for some; options that no function has stay."""
    paired = _PAIR.sub(lambda found: f'{_PAIRS[found[1]]}={{"{found[2]}": {found[3]}}}', text)
    return _OPTION.sub(partial(_parameter, others={**_OTHER_NAMES, **(others or {})}), paired)


def _parameter(found: re.Match[str], others: Mapping[str, str]) -> str:
    name, value = found[1], found[2]
    if name in _TRUTHS:
        return f"{name.replace('-', '_')}=True" + (f" {value}" if value else "")
    if name not in {*_VALUES, *others, *_PAIRS}:
        return found[0]
    parameter = others.get(name) or _PAIRS.get(name) or name.replace("-", "_")
    if value is None:
        return f"the parameter {parameter}"
    return f"{parameter}=({value.replace(':', ', ')})" if ":" in value else f"{parameter}={value}"


@contextlib.contextmanager
def naming_parameters(**others: str) -> Iterator[None]:
    """Reword the errors that come out of the block; `others` are parameters that stand for an option there."""
    try:
        yield
    except ToolkitError as error:
        error.args = (reworded(str(error), others), *error.args[1:])
        raise
