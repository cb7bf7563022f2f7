"""Results of a long measurement, kept in a file as they come, so that one that was cut off can go on."""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
_SOURCES = ("toolkit", "generator", "tests")


@dataclass(slots=True)
class Kept:
    """Results by name; those that other sources or tests gave do not count. Without a file they last for one run."""

    file: Path | None
    fingerprint: str
    known: dict[str, Any] = field(default_factory=dict)
    lock: Lock = field(default_factory=Lock)

    @classmethod
    def of(cls, file: Path | None) -> "Kept":
        """With what earlier runs have left in the file."""
        kept = cls(file, _fingerprint())
        if file is not None and file.exists():
            entries = [json.loads(line) for line in file.read_text().splitlines()]
            kept.known = {entry["name"]: entry["result"] for entry in entries if entry["of"] == kept.fingerprint}
        return kept

    def add(self, name: str, result: object) -> None:
        """Keep one; several threads may."""
        with self.lock:
            self.known[name] = result
            if self.file is not None:
                with self.file.open("a") as stream:
                    stream.write(json.dumps({"of": self.fingerprint, "name": name, "result": result}) + "\n")


def _fingerprint() -> str:
    digest = hashlib.sha256()
    for file in sorted([*(path for name in _SOURCES for path in (ROOT / name).rglob("*.py")), ROOT / "pyproject.toml"]):
        digest.update(file.relative_to(ROOT).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()
