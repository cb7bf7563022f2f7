"""What went wrong elsewhere, in one line that names the URL and the remedy; and what is worth another try."""

import errno
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from mcap_landmarks.errors import RemoteError, ToolkitError
from mcap_landmarks.remote.addresses import redacted, scheme_of, shown

T = TypeVar("T")

PAUSES_S = (0.25, 1.0, 4.0)
"""Between the tries of a request: botocore's standard mode, too, tries no more often than this; the last pause is as
long as a server takes to come back behind a load balancer. No chance in it, so that a run is the same each time."""

_CREDENTIALS = {
    "s3": "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE",
    "gs": "set GOOGLE_APPLICATION_CREDENTIALS to the file of a service account",
    "az": "set AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY, or AZURE_STORAGE_CONNECTION_STRING",
    "http": "give user and password in ~/.netrc, or use a signed URL",
}
_SAME = {"abfs": "az", "abfss": "az", "https": "http"}
_BUSY = {408, 425, 429, 500, 502, 503, 504}
"""Answers that RFC 9110, RFC 8470 and RFC 6585 give for a while only."""
_FOR_GOOD = {errno.EINVAL, errno.ENAMETOOLONG}
"""What s3fs says of requests that make no sense, such as an impossible name of a bucket."""


class ChangedError(OSError):
    """A file is another than when it was opened."""


class DroppedError(OSError):
    """Fewer bytes came than were asked for."""


class StatusError(OSError):
    """A web server refused; `status` is its number."""

    def __init__(self, status: int) -> None:
        super().__init__(f"the server answers {status}")
        self.status = status


class WholeOnlyError(Exception):
    """A web server gives no parts of files, or does not know their size. What it says of this one."""

    def __init__(self, version: str, size: int | None) -> None:
        super().__init__("the server gives no parts of files")
        self.version, self.size = version, size


@dataclass(frozen=True, slots=True)
class _Kind:
    """A way to fail: how to tell it, by names of exceptions, numbers of HTTP or words, and what to say of it.

    The names are those of Python, botocore, s3fs, google.auth, azure.core, azure.identity and aiohttp, none of which
    need be installed.
    """

    names: frozenset[str]
    statuses: frozenset[int]
    words: tuple[str, ...]
    problem: str
    passes: bool = False


def _kind(
    problem: str, *names: str, statuses: tuple[int, ...] = (), words: tuple[str, ...] = (), passes: bool = False
) -> _Kind:
    return _Kind(frozenset(names), frozenset(statuses), words, problem, passes)


_KINDS = (
    _kind(
        "it was changed while it was read; run again when nobody writes it",
        *("ChangedError", "FileExpired"),
        statuses=(412,),
    ),
    _kind(
        "there are no credentials for it; {credentials}",
        *("NoCredentialsError", "PartialCredentialsError", "CredentialRetrievalError", "TokenRetrievalError"),
        *("ProfileNotFound", "DefaultCredentialsError", "RefreshError", "CredentialUnavailableError"),
        *("ClientAuthenticationError", "NoAuthTokenError"),
        statuses=(401,),
        words=("with credentials", "Anonymous caller"),
    ),
    _kind(
        "access is denied; {credentials}",
        "PermissionError",
        statuses=(403,),
    ),
    _kind(
        "there is no such bucket; check its name",
        *("NoSuchBucket",),
        words=("bucket does not exist", "ContainerNotFound", "container does not exist"),
    ),
    _kind("there is no such file; check the URL", "FileNotFoundError", "ResourceNotFoundError", statuses=(404, 410)),
    _kind(
        "the host cannot be reached{again}; check its name and the network",
        *("EndpointConnectionError", "ConnectTimeoutError", "ProxyConnectionError", "ClientConnectorError"),
        *("ConnectionTimeoutError", "ServiceRequestError", "TransportError", "gaierror", "ConnectionRefusedError"),
        passes=True,
    ),
    _kind(
        "the host does not answer{again}; try again later",
        *("TimeoutError", "FSTimeoutError", "ReadTimeoutError"),
        passes=True,
    ),
    _kind(
        "the connection was dropped{again}; try again later",
        *("DroppedError", "ConnectionError", "HTTPClientError", "ServiceResponseError", "IncompleteReadError"),
        *("ClientPayloadError", "ClientConnectionError"),
        passes=True,
    ),
)


def persistently(text: str, attempt: Callable[[], T], is_closed: threading.Event | None = None) -> T:
    """What a request gives, which is made again when it failed for a passing cause; `is_closed` ends the pauses.

    Raises:
        RemoteError: it failed for good, or each time.
        WholeOnlyError: as the class says.
    """
    tries, stop = 1, is_closed or threading.Event()
    while True:
        try:
            return attempt()
        except WholeOnlyError:
            raise
        except Exception as error:
            if tries > len(PAUSES_S) or not is_passing(error):
                raise refusal(text, error, tries) from error
        if stop.wait(PAUSES_S[tries - 1]):
            raise RemoteError(f"{shown(text)} was closed while it was read; open it again")
        tries += 1


def is_passing(error: BaseException) -> bool:
    """Whether the same request can succeed a moment later."""
    if isinstance(error, ToolkitError) or not isinstance(error, Exception):
        return False
    if (status := _status(error)) in _BUSY:
        return True
    if (kind := _kind_of(error)) is not None:
        return kind.passes
    return status is None and isinstance(error, OSError) and error.errno not in _FOR_GOOD


def refusal(text: str, error: BaseException, tries: int = 1) -> ToolkitError:
    """The error to raise for what a library raised; one of ours stays as it is. Credentials are never part of it."""
    if isinstance(error, ToolkitError):
        return error
    scheme, kind, status = scheme_of(text), _kind_of(error), _status(error)
    again = f" ({tries} tries)" if tries > 1 else ""
    if kind is not None:
        credentials = _CREDENTIALS.get(_SAME.get(scheme, scheme), "check them")
        problem = kind.problem.format(again=again, credentials=credentials)
    elif status is not None:
        problem = f"the server answers {status}{again}; try again later, or ask who runs it"
    else:
        said = redacted(str(error).partition("\n")[0]) or type(error).__name__
        problem = f"it cannot be read or written ({said}){again}; check the URL"
    return RemoteError(f"{shown(text)}: {problem}")


def _kind_of(error: BaseException) -> _Kind | None:
    chain = _chain(error)
    names = {kind.__name__ for each in chain for kind in type(each).__mro__}
    status, said = _status(error), " ".join(map(str, chain))
    for kind in _KINDS:
        if kind.names & names or status in kind.statuses or any(words in said for words in kind.words):
            return kind
    return None


def _chain(error: BaseException) -> list[BaseException]:
    """An error and what caused it."""
    found = [error]
    while (cause := found[-1].__cause__) is not None and cause not in found:
        found.append(cause)
    return found


def _status(error: BaseException) -> int | None:
    """The number of HTTP that an error has, by one of the names that the libraries use."""
    for each in _chain(error):
        for name in ("status", "status_code", "code"):
            value = getattr(each, name, None)
            if isinstance(value, int) and 400 <= value < 600:
                return value
    return None
