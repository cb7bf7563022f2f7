"""URLs as they may be shown: without the credentials that they can hold."""

import re

from mcap_landmarks.errors import UsageError

URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+)://")
"""The beginning of one (RFC 3986, section 3.1); a single letter is a drive."""
_IN_TEXT = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://[^\s'\"<>]+")
_HIDDEN = "..."
_AZURE = {"abfs", "abfss"}
_WEB = {"http", "https"}


def scheme_of(text: str) -> str:
    """The scheme of a URL, in small letters.

    Raises:
        UsageError: it has none.
    """
    if match := URL.match(text):
        return match[1].lower()
    raise UsageError(f"{text} is no URL; write it as scheme://place/name")


def shown(text: str) -> str:
    """A URL without what may be secret in it: user and password, query and fragment, of which dots are left.

    Signatures and tokens stand in queries by many names, so that of none the value is shown. In `abfs://` what stands
    before the host is the container; of other schemes than the web's a fragment is part of the name.
    """
    scheme = scheme_of(text)
    begin = text.index("://") + 3
    end = min((place for mark in "/?#" if (place := text.find(mark, begin)) >= 0), default=len(text))
    host, rest = text[begin:end], text[end:]
    user, at, host = host.rpartition("@")
    if at and not (scheme in _AZURE and ":" not in user):
        user = _HIDDEN
    for mark in "#?" if scheme in _WEB else "?":
        name, found, _ = rest.partition(mark)
        rest = f"{name}{mark}{_HIDDEN}" if found else rest
    return f"{text[:begin]}{user}{at}{host}{rest}"


def check_no_password(text: str) -> None:
    """Refuse a URL with a password in it: it would stand in the history of the shell, and in lists of processes.

    Raises:
        UsageError: as it says.
    """
    place = re.split(r"[/?#]", text[text.index("://") + 3 :], maxsplit=1)[0]
    user, at, _ = place.rpartition("@")
    if at and (":" in user or scheme_of(text) in _WEB):
        raise UsageError(f"{shown(text)}: leave user and password out; credentials come from the environment")


def redacted(text: str) -> str:
    """A text of others, such as a library's error, with every URL in it as it may be shown."""
    return _IN_TEXT.sub(lambda found: shown(found[0]), text)
