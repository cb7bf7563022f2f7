"""Outputs elsewhere while they are made: in the user's cache folder, from which they are sent when they are whole."""

import contextlib
import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

from mcap_landmarks.errors import RemoteError, ToolkitError
from mcap_landmarks.remote.shown_copies import WATCH
from mcap_landmarks.remote.store_listing import urls_below
from mcap_landmarks.remote.uploads import remove_stored, upload
from mcap_landmarks.user_cache import user_cache


def staged_output(text: str) -> Path:
    """Where an output of this URL is made: always the same place, so that an interrupted run finds what it had."""
    place = text.rstrip("/")
    digest = hashlib.sha256(place.encode()).hexdigest()[:16]
    return user_cache() / "outputs" / digest / (PurePosixPath(urlsplit(place).path).name or "output")


def send_file(made: Path, text: str) -> None:
    """Send a file, and forget one that an earlier run could not send.

    Raises:
        RemoteError: it cannot be sent; it is kept then, where the error says.
    """
    with _kept_if_not_sent(made, text), WATCH.get()(f"send {staged_output(text).name}", made.stat().st_size) as advance:
        upload(made, text, advance)


def send_folder(made: Path, text: str) -> None:
    """Send the files of a folder in the order in which they were written, and remove all others below the URL.

    A store has no folders: its files appear one by one, and those that were sent are removed if one cannot be.

    Raises:
        RemoteError: it cannot be sent; it is kept then, where the error says.
    """
    files = sorted((path for path in made.rglob("*") if path.is_file()), key=lambda path: path.stat().st_mtime_ns)
    targets = [f"{text.rstrip('/')}/{path.relative_to(made).as_posix()}" for path in files]
    size, sent = sum(path.stat().st_size for path in files), list[str]()
    with _kept_if_not_sent(made, text), WATCH.get()(f"send {staged_output(text).name}", size) as advance:
        try:
            for path, target in zip(files, targets, strict=True):
                upload(path, target, advance)
                sent.append(target)
            for other in urls_below(text):
                if other not in targets:
                    remove_stored(other)
        except BaseException:
            for target in sent:
                with contextlib.suppress(ToolkitError):
                    remove_stored(target)
            raise


@contextlib.contextmanager
def _kept_if_not_sent(made: Path, text: str) -> Iterator[None]:
    """Keep what was made under its name if it cannot be sent: hours of work are worth more than a tidy cache."""
    kept = staged_output(text)
    _remove_kept(kept)
    try:
        yield
    except ToolkitError as error:
        made.rename(kept)
        what, _, remedy = str(error).rpartition("; ")
        raise RemoteError(f"{what}; {remedy}, or take what was made from {kept}, where it is kept") from error


def _remove_kept(kept: Path) -> None:
    if kept.is_dir():
        shutil.rmtree(kept)
    else:
        kept.unlink(missing_ok=True)
