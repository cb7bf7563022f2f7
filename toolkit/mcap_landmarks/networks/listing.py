"""The networks that `--model` knows by name: bundled, known to `models get`, or put into the cache by the user."""

from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.networks.cache import cached
from mcap_landmarks.networks.choice import BUNDLED, RENDERED_ONLY
from mcap_landmarks.networks.known import KNOWN
from mcap_landmarks.resources import detector


@dataclass(frozen=True, slots=True)
class Listed:
    """A network by name: `state` is `bundled`, `fetched`, `not fetched` or, of the user's own, `cached`."""

    name: str
    state: str
    about: str
    path: Path | None


def listed() -> list[Listed]:
    """All networks, the bundled one first.

    Raises:
        ToolkitError: this installation lacks the bundled one.
    """
    there = cached()
    found = [Listed(BUNDLED, "bundled", RENDERED_ONLY, detector())]
    for name, network in KNOWN.items():
        about = f"{network.title}; licence: {network.terms}"
        found.append(Listed(name, "fetched" if name in there else "not fetched", about, there.get(name)))
    others = [name for name in there if name not in KNOWN]
    return [*found, *(Listed(name, "cached", "put into the cache by hand", there[name]) for name in others)]
