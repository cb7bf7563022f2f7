"""What an output may replace: never what is read, and what is there only if it is an earlier result of the same."""

import contextlib
import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.atomic import check_target, held
from mcap_landmarks.errors import RecordingError, ToolkitError, UsageError
from mcap_landmarks.locations import Location, Url, address, check_there, files_in, is_there
from mcap_landmarks.manifest import CONTENT, RUN, entry_text, file_hash
from mcap_landmarks.recording.reader import open_recording

IsEarlier = Callable[[Location], bool]
"""Says of a file that is there whether it is an earlier result of what is made now."""


@dataclass(frozen=True, slots=True)
class Replacing:
    """What outputs may replace: earlier results of the same, or with `overwrite` anything but what is read."""

    is_earlier: IsEarlier
    overwrite: bool


@contextlib.contextmanager
def output_to(
    target: Location,
    read: Iterable[Location],
    is_earlier: IsEarlier,
    *,
    overwrite: bool = False,
    is_folder: bool = False,
) -> Iterator[None]:
    """Hold an output, a file or a folder; no other process writes it while the block runs, which may replace it.

    Raises:
        UsageError: it cannot be written, is one of the files that are `read`, or has to stay (see `check_replaceable`).
        RecordingError: another process writes it, or the folder may not be written.
    """
    check_apart([check_target(target, is_folder=is_folder)], read)
    with held(target, is_folder=is_folder):
        check_replaceable(target, is_earlier, overwrite=overwrite, is_folder=is_folder)
        yield


@contextlib.contextmanager
def new_files(
    targets: Iterable[Location | None], read: Iterable[Location | None], *, overwrite: bool = False
) -> Iterator[None]:
    """Hold outputs that do not tell what they were made of, as far as they are named: none may exist.

    Raises:
        UsageError, RecordingError: see `output_to`.
    """
    named = [check_target(target) for target in targets if target is not None]
    check_apart(named, [place for place in read if place is not None])
    with contextlib.ExitStack() as stack:
        for target in named:
            stack.enter_context(output_to(target, (), lambda _place: False, overwrite=overwrite))
        yield


def check_apart(targets: Collection[Location], read: Iterable[Location]) -> None:
    """Refuse outputs that are one file, or that are read: also by another name, through links, or in a folder.

    Raises:
        UsageError: as it says.
        RemoteError: what is read is elsewhere, and not there.
    """
    known: dict[str, Location] = {}
    for target in targets:
        other = known.setdefault(address(target), target)
        if other is not target:
            raise UsageError(f"{target}: two outputs would be this file; give each a name of its own")
    sources = list(read)
    for source in sources:
        check_there(source)
    for target in targets:
        for source in sources:
            if isinstance(target, Path) and isinstance(source, Path) and target.exists():
                _check_pair(target, source)
            elif isinstance(target, Url) and isinstance(source, Url):
                _check_addresses(target, source)


def _check_addresses(target: Url, source: Url) -> None:
    mine, theirs = (f"{address(place).partition('?')[0]}/" for place in (target, source))
    if mine == theirs:
        raise UsageError(f"{target} is the input itself; write to another file")
    if mine.startswith(theirs):
        raise UsageError(f"{target} is part of the input {source}; write to another file")


def _check_pair(path: Path, source: Path) -> None:
    if _is_same(path, source):
        named = "the input itself" if path == source else f"the input {source} itself"
        raise UsageError(f"{path} is {named}; write to another file")
    if source.is_dir() and _is_in(path, source):
        raise UsageError(f"{path} is part of the input {source}; write to another file")
    if path.is_dir() and _is_in(source, path):
        raise UsageError(f"{path} holds the input {source}; write to another folder")


def check_replaceable(target: Location, is_earlier: IsEarlier, *, overwrite: bool, is_folder: bool = False) -> None:
    """Refuse to replace what is there, unless it is an earlier result or the user says so.

    Raises:
        UsageError: as it says.
    """
    if overwrite:
        return
    exists = bool(files_in(target)) if is_folder and isinstance(target, Url) else is_there(target)
    if exists and not is_earlier(target):
        raise UsageError(
            f"{target} exists and is no earlier result of the same verb and inputs; write to another file, or replace "
            "it with --overwrite"
        )


def earlier_recording(verb: str, inputs: Sequence[str]) -> IsEarlier:
    """Recordings that a verb made of recordings with these fingerprints, with whatever settings."""
    return _recording_with(_made_by(verb, inputs))


def generated_recording(entries: Mapping[str, str]) -> IsEarlier:
    """Recordings of the same scenario and seed as the one with a manifest of these entries."""
    return _recording_with({name: entries.get(name) for name in ("verb", "config", "seed")})


def earlier_map(verb: str, inputs: Sequence[str]) -> IsEarlier:
    """Landmark databases that a verb made of recordings with these fingerprints, with whatever settings."""
    from mcap_landmarks.maps.database import read_manifest  # noqa: PLC0415 - few verbs make maps, all use this file

    made = _made_by(verb, inputs)
    return lambda path: _agree(read_manifest(path), made)


def picture_mark(verb: str, inputs: Iterable[Location]) -> str:
    """What a picture carries to be known again: the verb and a hash over what it shows."""
    digest = hashlib.sha256("".join(map(_identity, inputs)).encode())
    return f"mcap-landmarks {verb} of {digest.hexdigest()}"


def earlier_picture(verb: str, inputs: Sequence[Location]) -> IsEarlier:
    """Pictures that carry `picture_mark`."""
    return lambda path: _holds(path, picture_mark(verb, inputs))


def consists_of(content: bytes) -> IsEarlier:
    """Files with this very content, for what has no place to tell what it was made of: nothing is lost with them."""

    def is_earlier(place: Location) -> bool:
        with place.open("rb") as stream:
            return stream.read(len(content) + 1) == content

    return is_earlier


def carries(text: str) -> IsEarlier:
    """Files with a text among their bytes."""
    return lambda path: _holds(path, text)


def _holds(place: Location, text: str) -> bool:
    with place.open("rb") as stream:
        return text.encode() in stream.read()


def _made_by(verb: str, inputs: Sequence[str]) -> dict[str, str | None]:
    return {"verb": entry_text(verb), "inputs": entry_text(list(inputs))}


def _recording_with(made: Mapping[str, str | None]) -> IsEarlier:
    def is_earlier(path: Location) -> bool:
        try:
            with open_recording(path) as recording:
                entries = recording.metadata.get(RUN, {})
                return _agree(entries, made) and (CONTENT not in entries or recording.is_ours)
        except RecordingError:
            return False

    return is_earlier


def _agree(entries: Mapping[str, str], made: Mapping[str, str | None]) -> bool:
    return all(_in_any_order(entries.get(name)) == _in_any_order(value) for name, value in made.items())


def _in_any_order(text: str | None) -> object:
    """The value of an entry; of logs that were named in another order the same is made."""
    try:
        value = json.loads(text) if text is not None else None
    except (ValueError, RecursionError):
        return text
    return sorted(value, key=entry_text) if isinstance(value, list) else value


def _identity(place: Location) -> str:
    """The fingerprint of a recording, so that its results do not change it; a hash of any other file.

    What cannot be read has none, which is told by who reads it.
    """
    try:
        with open_recording(place) as recording:
            return recording.fingerprint()
    except RecordingError:
        with contextlib.suppress(ToolkitError):
            return file_hash(place)
    return ""


def _is_same(path: Path, source: Path) -> bool:
    try:
        return path.samefile(source)
    except OSError:  # there is no such input, which is told where it is opened
        return False


def _is_in(path: Path, folder: Path) -> bool:
    inside = path.resolve().is_relative_to(folder.resolve())
    return inside or any(_is_same(path, file) for file in folder.rglob("*") if file.is_file())
