"""What `info --check` says of a log: one finding for each thing that costs results."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """Something about a topic that costs results: `problem` where a verb fails or gives nothing, else `warning`."""

    level: str
    check: str
    topic: str
    text: str
    remedy: str
