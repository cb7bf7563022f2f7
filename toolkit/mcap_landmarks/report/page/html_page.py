"""A page as one HTML file: templates, style, scripts and data in it, and a policy that forbids all network."""

import base64
import hashlib
import json
import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from mcap_landmarks import __version__

_TEMPLATES = Path(__file__).parent / "templates"
_DIGITS = 4
"""Digits behind the point of figures in the data: a tenth of a millimetre."""
_UNSAFE = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&"}
"""What could end a script element or begin another, as JSON can write it, too."""


def html_page(
    template: str, values: Mapping[str, object], data: Mapping[str, object], mark: str, *, has_plots: bool
) -> bytes:
    """The page of a template with its values, and the data that its script draws. The same input, the same bytes.

    All values are escaped. `mark` goes into the metadata; with plots the page carries the library that draws them.
    """
    own = _normal((_TEMPLATES / "page.js").read_text())
    scripts = (
        [_normal(files("plotly").joinpath("package_data", "plotly.min.js").read_text()), own] if has_plots else [own]
    )
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(template).render(
        **values,
        policy=_policy(scripts),
        mark=mark,
        version=__version__,
        css=Markup((_TEMPLATES / "page.css").read_text()),  # noqa: S704 - these are files of ours, and plotly's
        scripts=[Markup(script) for script in scripts],  # noqa: S704
        data=Markup(json_in_html(data)),  # noqa: S704
    )
    return text.encode(errors="replace")


def json_in_html(data: object) -> str:
    """JSON that may stand in a script element: ASCII without what HTML knows; figures rounded, null if not finite."""
    return json.dumps(_plain(data), separators=(",", ":"), ensure_ascii=True).translate(_UNSAFE)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
    return value


def _normal(script: str) -> str:
    """A script with the line ends that a browser makes of it before it hashes it."""
    return script.replace("\r\n", "\n").replace("\r", "\n")


def _policy(scripts: list[str]) -> str:
    """What a browser may do: run these scripts and show pictures that are in the page. Nothing may be loaded.

    Plotly sets styles of elements, which only 'unsafe-inline' allows; no style comes out of a log.
    """
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{one}'" for one in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
