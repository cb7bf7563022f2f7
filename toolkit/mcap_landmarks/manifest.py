"""What ran to make an output: written into every one, and free of clocks, paths and hosts."""

import hashlib
import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TypedDict, TypeVar

from mcap_landmarks import __version__
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.locations import Location, to_read

_T = TypeVar("_T")
RUN = "mcap-landmarks.run"
"""Name of the metadata record that holds the manifest."""
GENERATE = "generate"
"""The verb of the generator's own recordings."""
CONTENT = "content"
"""Entry of the manifest with a hash over the chunks that it was written beside: who edits the file breaks it."""
LOSSES = "losses"
"""Entry of the manifest with what of the input could not be read when the output was written."""
GENERATED = "generated"
"""Entry of the manifest that is true where the generator made all that was sensed, so also in what was made of it."""
CARRIED = "carried"
"""Entry of the manifest with the number of messages, by topic, from before a cut that were carried over to it."""
SHARED_CHANNELS = "shared"
"""Entry of the manifest with the results on a channel of the log's own: by stage its id, and what tells them."""
STAGE = "mcap-landmarks.stage"
"""Entry of a channel's metadata that names the stage whose results it holds."""
RECORDING = "recording"
"""What a stage's inputs call the recording itself."""


class OutcomeEntry(TypedDict):
    """An `Outcome` as JSON values."""

    bundles: int
    unreadable: int
    counts: dict[str, int]
    dropped: dict[str, int]
    losses: list[str]
    notes: list[str]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a stage did: bundles, those that could not be read, its results by kind, and what was left out or lost."""

    bundles: int = 0
    unreadable: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    dropped: Mapping[str, int] = field(default_factory=dict)
    losses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def entry(self) -> OutcomeEntry:
        """The outcome as JSON values."""
        return {
            "bundles": self.bundles,
            "unreadable": self.unreadable,
            "counts": dict(self.counts),
            "dropped": dict(self.dropped),
            "losses": list(self.losses),
            "notes": list(self.notes),
        }

    @classmethod
    def of(cls, entry: OutcomeEntry) -> "Outcome":
        """The outcome that `entry` made JSON values of."""
        counts, dropped = entry["counts"], entry["dropped"]
        return cls(
            entry["bundles"], entry["unreadable"], counts, dropped, tuple(entry["losses"]), tuple(entry["notes"])
        )


@dataclass(frozen=True, slots=True)
class StageRecord:
    """What a stage's results were made from, and what came of it.

    `code` is a hash of the toolkit's sources, `resources` hashes by name. `inputs` names the recording by its
    fingerprint and the stages whose results were read by their keys. `options` are choices beside the configuration:
    topics, remaps, thinning. Results are the same if, and are reused only if, their keys are equal and they are whole:
    an output of less time than its input, or with other markers, carries older results on of which a part `is_cut`
    off. `origins` tells where the resources come from that were chosen; the same file is the same file wherever it lay.
    """

    stage: str
    code: str
    config: Mapping[str, object]
    resources: Mapping[str, str]
    inputs: Mapping[str, str]
    options: Mapping[str, object] = field(default_factory=dict)
    outcome: Outcome = field(default_factory=Outcome)
    is_cut: bool = False
    origins: Mapping[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """SHA-256 of all that decides the results."""
        parts = [self.stage, self.code, self.config, self.resources, self.inputs, self.options]
        return text_hash(entry_text(parts))

    def difference(self, other: "StageRecord") -> str:
        """What decides otherwise here than in an earlier record, in words; empty if nothing does."""
        if self.key == other.key:
            return ""
        if self.inputs.get(RECORDING) != other.inputs.get(RECORDING):
            return "the recording or the part of it that is read is another"
        for what, new, old in (
            ("", self.config, other.config),
            ("the file ", self.resources, other.resources),
            ("the option ", self.options, other.options),
        ):
            changed = sorted(name for name in {*new, *old} if entry_text(new.get(name)) != entry_text(old.get(name)))
            if changed:
                return f"{what}{', '.join(changed)} changed"
        read = sorted(name for name in {*self.inputs, *other.inputs} if self.inputs.get(name) != other.inputs.get(name))
        if read:
            return f"the results of {', '.join(read)} changed"
        return "the program changed"

    @property
    def file_name(self) -> str:
        """Name of a recording that holds these results alone."""
        return f"{self.stage}-{self.key}.mcap"

    def with_outcome(self, outcome: Outcome) -> "StageRecord":
        """The record of results that are there now."""
        return replace(self, outcome=outcome)

    def entry(self) -> dict[str, object]:
        """The record as JSON values, with its key; the configuration stands elsewhere in the manifest."""
        return {
            "key": self.key,
            "code": self.code,
            "resources": dict(self.resources),
            "inputs": dict(self.inputs),
            "options": dict(self.options),
            "outcome": self.outcome.entry(),
            "is_cut": self.is_cut,
            **({"origins": dict(self.origins)} if self.origins else {}),
        }


@dataclass(frozen=True, slots=True)
class Manifest:
    """Verb, effective configuration by stage, fingerprints of the input recordings, hashes of the other files.

    `fingerprint` is that of the recording whose messages the output carries on, so that results never change it.
    `stages` are the stages whose results the output holds; their configurations and files are listed with the others.
    `generated` says that the input is the generator's.
    """

    verb: str
    config: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()
    resources: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, object] = field(default_factory=dict)
    fingerprint: str = ""
    seed: int | None = None
    stages: tuple[StageRecord, ...] = ()
    generated: bool = False

    def entries(self) -> dict[str, str]:
        """The manifest as entries of a metadata record: one JSON text per key."""
        content: dict[str, object] = {
            "verb": self.verb,
            "version": __version__,
            "machine": platform.machine(),
            "config": {**self.config, **{record.stage: record.config for record in self.stages}},
            "inputs": list(self.inputs),
            "resources": {**self.resources, **{k: v for r in self.stages for k, v in r.resources.items()}},
            "options": self.options,
        }
        if self.seed is not None:
            content["seed"] = self.seed
        if self.generated:
            content[GENERATED] = True
        if self.fingerprint:
            content["fingerprint"] = self.fingerprint
        if self.stages:
            content["stages"] = {record.stage: record.entry() for record in self.stages}
        return {key: entry_text(value) for key, value in content.items()}


def stage_records(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, StageRecord]:
    """The stages whose results a recording of ours holds, as its manifest tells; none for other recordings."""
    entries = metadata.get(RUN, {})
    try:
        config = json.loads(entries.get("config", "{}"))
        found = {}
        for name, entry in json.loads(entries.get("stages", "{}")).items():
            key, outcome = entry.pop("key"), Outcome.of(entry.pop("outcome"))
            record = StageRecord(name, config=config[name], outcome=outcome, **entry)
            if record.key == key:
                found[name] = record
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
    ):  # of another version: nothing in it can be reused
        return {}
    return found


def is_generated(metadata: Mapping[str, Mapping[str, str]]) -> bool:
    """Whether the generator made a recording, or what it was made of."""
    entries = metadata.get(RUN, {})
    return entries.get("verb") == entry_text(GENERATE) or entries.get(GENERATED) == entry_text(True)


def carried_fingerprint(metadata: Mapping[str, Mapping[str, str]], content: str) -> str | None:
    """The fingerprint that an output of ours carries on, None for other recordings and for those edited since.

    `content` is the hash over the chunks that are there.
    """
    entries = metadata.get(RUN, {})
    text = entries.get("fingerprint")
    return told(text, "") if text and entries.get(CONTENT) == entry_text(content) else None


def told_losses(metadata: Mapping[str, Mapping[str, str]]) -> list[str]:
    """What of its input could not be read when an output was written."""
    losses: list[object] = told(metadata.get(RUN, {}).get(LOSSES), [])
    return [str(loss) for loss in losses]


def told_carried(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, int]:
    """The number of messages, by topic, from before its start that an output carried over."""
    counts: dict[str, object] = told(metadata.get(RUN, {}).get(CARRIED), {})
    return {topic: count for topic, count in counts.items() if isinstance(count, int)}


def told(text: str | None, otherwise: _T) -> _T:
    """What an entry of a manifest says, of the type of `otherwise`; that where there is none or it is damaged."""
    try:
        value = json.loads(text or "")
    except (ValueError, RecursionError):
        return otherwise
    return value if isinstance(value, type(otherwise)) else otherwise


def narrowed(fingerprint: str, **limits: object) -> str:
    """The fingerprint of a part of a recording; `limits` say which part, those that are None or False do not count."""
    given = {name: limit for name, limit in limits.items() if limit not in (None, False)}
    return text_hash(entry_text([fingerprint, given])) if given else fingerprint


@cache
def code_hash() -> str:
    """SHA-256 over the toolkit's sources."""
    digest = hashlib.sha256()
    folder = Path(__file__).resolve().parent
    for path in sorted(folder.rglob("*.py"), key=lambda path: path.relative_to(folder).as_posix()):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def text_hash(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def file_hash(path: Location, progress: Callable[[int], None] | None = None) -> str:
    """SHA-256 of a file's content; `progress` is told the bytes that were read.

    Raises:
        ToolkitError: the file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with to_read(path).open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
                if progress:
                    progress(len(block))
    except OSError as error:
        raise ToolkitError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return digest.hexdigest()


def entry_text(value: object) -> str:
    """The text of one entry of a manifest."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
