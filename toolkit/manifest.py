"""What ran to make an output: written into every one, and free of clocks, paths and hosts."""

import hashlib
import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from toolkit import __version__
from toolkit.errors import ToolkitError

RUN = "mcap-landmarks.run"
"""Name of the metadata record that holds the manifest."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """Verb, effective configuration by stage, fingerprints of the input recordings, hashes of the other files.

    `fingerprint` is that of the recording whose messages the output carries on, so that results never change it.
    """

    verb: str
    config: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()
    resources: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, object] = field(default_factory=dict)
    fingerprint: str = ""
    seed: int | None = None

    def entries(self) -> dict[str, str]:
        """The manifest as entries of a metadata record: one JSON text per key."""
        content: dict[str, object] = {
            "verb": self.verb,
            "version": __version__,
            "machine": platform.machine(),
            "config": self.config,
            "inputs": list(self.inputs),
            "resources": self.resources,
            "options": self.options,
        }
        if self.seed is not None:
            content["seed"] = self.seed
        if self.fingerprint:
            content["fingerprint"] = self.fingerprint
        return {key: json.dumps(value, sort_keys=True, ensure_ascii=False) for key, value in content.items()}


def carried_fingerprint(metadata: Mapping[str, Mapping[str, str]]) -> str | None:
    """The fingerprint that an output of ours carries on, None for other recordings."""
    text = metadata.get(RUN, {}).get("fingerprint")
    return str(json.loads(text)) if text else None


def file_hash(path: Path, progress: Callable[[int], None] | None = None) -> str:
    """SHA-256 of a file's content; `progress` is told the bytes that were read.

    Raises:
        ToolkitError: the file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
                if progress:
                    progress(len(block))
    except OSError as error:
        raise ToolkitError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return digest.hexdigest()
