"""Which network detects: the one decision, for every verb that runs `detect` and for `info --check`."""

from pathlib import Path

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.networks.cache import cached
from mcap_landmarks.networks.known import KNOWN
from mcap_landmarks.resources import detector
from mcap_landmarks.stage import Chosen

BUNDLED = "bundled"
"""What `--model` calls the network that travels with the program."""
RENDERED_ONLY = (
    "the bundled network knows rendered objects only (on 40 photographs it found 0 of 33 people, and 121 bicycles that "
    "were trees)"
)
REAL_ONES = (
    "get a real network once with `mcap-landmarks models get nanodet`, or give one with --model FILE.onnx, such as a "
    "YOLO export; --model bundled takes the bundled one all the same"
)


def choose_network(asked: Location | None, generated: bool) -> Chosen:
    """The network for a log: the one that is asked for, by file or name; for a log that the generator made the bundled
    one, which was trained on such images; else the one in the cache.

    Raises:
        UsageError: there is no network of that name, or none that fits, or there are several.
        ToolkitError: this installation lacks the bundled one.
    """
    if asked is not None:
        return _named(asked)
    if generated:
        return Chosen(detector(), BUNDLED)
    there = cached()
    if not there:
        raise UsageError(f"no network for real images is there: {RENDERED_ONLY}; {REAL_ONES}")
    if len(there) > 1:
        raise UsageError(f"the cache has the networks {', '.join(there)}; choose one with --model NAME")
    ((name, path),) = there.items()
    return Chosen(path, name)


def _named(asked: Location) -> Chosen:
    """A network by file, or by a name: one word without a dot."""
    name = str(asked)
    there = cached()
    if not (isinstance(asked, Path) and asked.parent == Path() and not asked.suffix):
        return Chosen(asked, "file")
    if name == BUNDLED:
        return Chosen(detector(), BUNDLED)
    if name in there:
        return Chosen(there[name], name)
    if name in KNOWN:
        raise UsageError(f"--model {name}: it is not in the cache yet; run `mcap-landmarks models get {name}` once")
    if asked.is_file():
        return Chosen(asked, "file")
    known = ", ".join((BUNDLED, *sorted({*there, *KNOWN})))
    raise UsageError(f"--model {name}: neither a file nor a network here; there are {known}, or give FILE.onnx")
