"""What of a bag is lost, as far as it can be counted: by cause, by chunk, and by stretch of its file."""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable


class LostStretch(NamedTuple):
    """Bytes of a file from `start` on and before `end` that were passed over, and why."""

    start: int
    end: int
    reason: str


@dataclass(slots=True)
class LossAccount:
    """Grows while messages are read, once.

    `messages` are lost by cause, None where nothing tells how many; `undeclared` of them are not among those that the
    storage declares for a topic. `chunks` are damaged, by their place: how many of their messages are lost, None
    likewise, and why. `is_open`: more may be lost than is counted, and nothing tells how many messages there were.
    """

    messages: dict[str, int | None] = field(default_factory=dict)
    undeclared: int = 0
    chunks: dict[int, tuple[int | None, str]] = field(default_factory=dict)
    passed_over: list[LostStretch] = field(default_factory=list)
    is_open: bool = False

    def add(self, cause: str, messages: int | None = 1, *, is_declared: bool = True) -> None:
        """Count messages that are lost for a cause; None is kept only where no number comes."""
        known = self.messages.get(cause)
        self.messages[cause] = known if messages is None else (known or 0) + messages
        if not is_declared:
            self.undeclared += messages or 0


@runtime_checkable
class Accounted(Protocol):
    """A part of a log that has such an account."""

    @property
    def account(self) -> LossAccount:
        """What is lost so far."""
