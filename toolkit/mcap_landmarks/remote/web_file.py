"""A file on a web server, read in parts (RFC 9110, section 14) through the session of fsspec's file system."""

import codecs
import re
from typing import NamedTuple, Protocol, cast

import aiohttp
from fsspec.asyn import sync
from yarl import URL

from mcap_landmarks.errors import RemoteError
from mcap_landmarks.remote.addresses import shown
from mcap_landmarks.remote.refusals import ChangedError, DroppedError, StatusError, WholeOnlyError
from mcap_landmarks.remote.stores import FileSystem

BEGIN = 16 << 10
"""So many bytes come with the answer that tells the size: of a recording its header, of small files all."""
_CONTENT_RANGE = re.compile(r"bytes (?:(\d+)-(\d+)|\*)/(\d+)")
_TELLING = 64
"""So many bytes tell a web page."""
_TIMEOUT = aiohttp.ClientTimeout(total=None, sock_connect=15, sock_read=60)
"""Seconds; s3fs waits 5 and 15 within its own data centre, and a slow line shall not be taken for a dead one."""


class _WebFileSystem(Protocol):
    loop: object

    async def set_session(self) -> aiohttp.ClientSession: ...


class _Answer(NamedTuple):
    content: bytes
    size: int
    version: str
    content_type: str


class WebFile:
    """See `StoredFile`. The file is told from a later one by its ETag, or its time of change, and its size."""

    def __init__(self, file_system: FileSystem, text: str) -> None:
        self._file_system = cast("_WebFileSystem", file_system)
        self._text = text
        self._url = URL(text, encoded="%" in text)  # a signed URL stays as it was signed
        first = self._ask(0, BEGIN)
        self._check_no_page(first.content_type, first.content[:_TELLING])
        self.size, self.version, self.begin = first.size, first.version, first.content

    def bytes_of(self, start: int, end: int) -> bytes:
        """See `StoredFile`."""
        found = self._ask(start, end)
        if (found.size, found.version) != (self.size, self.version):
            raise ChangedError
        if len(found.content) != end - start:
            raise DroppedError
        return found.content

    def _ask(self, start: int, end: int) -> _Answer:
        answer: _Answer = sync(self._file_system.loop, self._answer, start, end)
        return answer

    def _check_no_page(self, content_type: str, begin: bytes) -> None:
        """Refuse what servers give for folders, logins and errors.

        Raises:
            RemoteError: it is a web page.
        """
        markup = begin.removeprefix(codecs.BOM_UTF8).lstrip().lower()
        is_named_page = content_type == "text/html" and markup.startswith(b"<")
        if is_named_page or markup.startswith((b"<!doctype html", b"<html")):
            raise RemoteError(f"{shown(self._text)}: is a web page, not a recording; give the URL of the file itself")

    async def _answer(self, start: int, end: int) -> _Answer:
        headers = {"Range": f"bytes={start}-{end - 1}", "Accept-Encoding": "identity"}
        session = await self._file_system.set_session()
        async with session.get(self._url, headers=headers, timeout=_TIMEOUT) as response:
            place = _CONTENT_RANGE.fullmatch(response.headers.get("Content-Range", ""))
            version = response.headers.get("ETag") or response.headers.get("Last-Modified") or ""
            if response.status == 200 or (response.status == 206 and place is None):
                self._check_no_page(response.content_type, await response.content.read(_TELLING))
                raise WholeOnlyError(version, response.content_length)
            if response.status == 416 and place is not None:  # nothing lies there: it is empty, or shorter than it was
                return _Answer(b"", int(place[3]), version, response.content_type)
            if response.status != 206 or place is None:
                raise StatusError(response.status)
            content = await response.read()
            if place[1] is None or int(place[1]) != start:
                raise DroppedError
            return _Answer(content, int(place[3]), version, response.content_type)
