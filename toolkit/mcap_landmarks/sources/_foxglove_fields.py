"""The fields of a message of Foxglove's types by name, whatever its encoding; of JSON, and of ROS 2's CDR."""

import base64
import binascii
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Self

import numpy as np

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.parts import Array
from mcap_landmarks.messages.typestore import RosObject

MOST_PARTS = 1 << 16
"""A message of more parts, such as transforms, is refused: as objects so many take 100 MB, however short they are."""
_SECONDS, _NANOSECONDS = ("sec", "seconds"), ("nsec", "nanos", "nanosec")
"""What the parts of a time are called in Foxglove's JSON schemas, in protobuf, and in ROS 2."""
_RFC_3339 = re.compile(r"(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?([Zz]|[+-]\d\d:\d\d)")
COVARIANCES = ("UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN")
NUMBERS = ("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
"""The names of what Foxglove's schemas number: kinds of a covariance, types of numbers, levels of a log."""
_CAMEL = re.compile(r"_(\w)")


class FieldsOf(ABC):
    """The fields of one message or of a part of it; a missing one is what protobuf takes for it, zero or empty.

    Every method raises MessageError where a field is of another kind than what is asked for.
    """

    @abstractmethod
    def get(self, name: str) -> object:
        """A field as it lies in the message, None where there is none."""

    @abstractmethod
    def _inner(self, value: object) -> Self | None:
        """The fields of a message within, None where a value is none."""

    def require(self, *names: str) -> None:
        """Refuse a message that lacks a field which no message of its type can be without."""
        for name in names:
            if self.get(name) is None:
                raise MessageError(f"it has no field {name}")

    def number(self, name: str) -> float:
        """A number; JSON has those that are not finite as text."""
        value = self.get(name)
        if not isinstance(value, int | float | str | np.number | None):
            raise MessageError(f"{name} is no number")
        try:
            return float(value or 0.0)
        except (ValueError, OverflowError) as error:
            raise MessageError(f"{name} is no number") from error

    def integer(self, name: str) -> int:
        """A whole number."""
        value = self.number(name)
        if not value.is_integer():
            raise MessageError(f"{name} is {value}, not a whole number")
        return int(value)

    def choice(self, name: str, names: Sequence[str]) -> int:
        """The number of one of some names, which protobuf's own JSON writes in its place."""
        value = self.get(name)
        return names.index(value) if isinstance(value, str) and value in names else self.integer(name)

    def text(self, name: str) -> str:
        """Text."""
        value = self.get(name)
        if not isinstance(value, str | None):
            raise MessageError(f"{name} is no text")
        return value or ""

    def data(self, name: str) -> bytes:
        """Bytes."""
        value = self.get(name)
        if not isinstance(value, bytes | None):
            raise MessageError(f"{name} is no bytes")
        return value or b""

    def numbers(self, name: str) -> Array:
        """The numbers (N,) of a repeated field; JSON has null where one is not finite, which becomes not a number."""
        values = self.get(name)
        try:
            return np.array(values if isinstance(values, np.ndarray) else self._items(name), dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise MessageError(f"{name} are no numbers") from error

    def part(self, name: str) -> Self | None:
        """A message within, None where there is none."""
        value = self.get(name)
        return None if value is None else self._wrapped(name, value)

    def parts(self, name: str) -> list[Self]:
        """The messages of a repeated field."""
        items = self._items(name)
        if len(items) > MOST_PARTS:
            raise MessageError(f"it has {len(items)} {name}, and at most {MOST_PARTS} are read")
        return [self._wrapped(name, item) for item in items]

    def time_ns(self, name: str) -> int:
        """A time or a duration in nanoseconds, zero where there is none."""
        value = self.get(name)
        if isinstance(value, str):
            return _nanoseconds(name, value)
        part = self.part(name)
        return 0 if part is None else part.first(_SECONDS) * 10**9 + part.first(_NANOSECONDS)

    def first(self, names: Sequence[str]) -> int:
        """The whole number of the first of some names that there is, zero where there is none."""
        return next((self.integer(name) for name in names if self.get(name) is not None), 0)

    def _wrapped(self, name: str, value: object) -> Self:
        inner = self._inner(value)
        if inner is None:
            raise MessageError(f"{name} is no message")
        return inner

    def _items(self, name: str) -> Sequence[object]:
        values = self.get(name)
        if values is None:
            return ()
        if not isinstance(values, Sequence) or isinstance(values, str | bytes):
            raise MessageError(f"{name} is no list")
        return values


class JsonFields(FieldsOf):
    """Of JSON, by the names of Foxglove's JSON schemas or as protobuf's own JSON has them: `frame_id` or `frameId`."""

    def __init__(self, content: Mapping[str, object]) -> None:
        self._content = content

    @classmethod
    def read(cls, data: bytes | memoryview) -> Self:
        """The fields of a message."""
        try:
            content = json.loads(bytes(data))
        except (ValueError, RecursionError) as error:
            raise MessageError(f"{len(data)} bytes are no JSON: {error}") from error
        if not isinstance(content, dict):
            raise MessageError(f"{len(data)} bytes are no JSON object")
        return cls(content)

    def get(self, name: str) -> object:
        """See `FieldsOf`."""
        found = self._content.get(name)
        return found if found is not None else self._content.get(_CAMEL.sub(lambda match: match[1].upper(), name))

    def data(self, name: str) -> bytes:
        """Bytes, which are text in base64 here."""
        try:
            return base64.b64decode(self.text(name), validate=True)
        except binascii.Error as error:
            raise MessageError(f"{name} is not of base64: {error}") from error

    def _inner(self, value: object) -> Self | None:
        return type(self)(value) if isinstance(value, dict) else None


class RosFields(FieldsOf):
    """Of a message in CDR, whose names are in small letters there."""

    def __init__(self, content: RosObject) -> None:
        self._content = content

    def get(self, name: str) -> object:
        """See `FieldsOf`."""
        value = getattr(self._content, name, None)
        return value if value is not None else getattr(self._content, name.lower(), None)

    def data(self, name: str) -> bytes:
        """Bytes."""
        value = self.get(name)
        if not isinstance(value, np.ndarray | None):
            raise MessageError(f"{name} is no bytes")
        return b"" if value is None else value.tobytes()

    def _inner(self, value: object) -> Self | None:
        return type(self)(value) if hasattr(value, "__msgtype__") else None


def _nanoseconds(name: str, text: str) -> int:
    """Of a time as RFC 3339 has it, or a duration as protobuf's JSON has it (`1.5s`)."""
    found = _RFC_3339.fullmatch(text)
    try:
        if found is None:
            return round(float(text.removesuffix("s")) * 1e9)
        day, time, fraction, zone = found.groups()
        since = datetime.fromisoformat(f"{day}T{time}{zone.upper().replace('Z', '+00:00')}") - datetime.fromtimestamp(
            0, UTC
        )
    except (ValueError, OverflowError) as error:
        raise MessageError(f"{name} is no time: {text[:40]!r}") from error
    return since // timedelta(seconds=1) * 10**9 + int((fraction or "").ljust(9, "0"))
