"""What rosbag2 keeps of a bag as a whole: the text of metadata.yaml, and of the metadata record of MCAP."""

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from mcap_landmarks.messages.qos import is_named, named, numbered

RECORD = "rosbag2"
KEY = "serialized_metadata"
_OF_TEXT, _OF_NAMES = 8, 9
"""The versions of Iron and Jazzy. The first keeps profiles as text with numbers, which every later rosbag2 reads. By
the second it reads names, also those of the channels, and takes numbers for unknown."""
_NEVER_NS = 2**63 - 1  # what rosbag2 writes as the start of a bag without messages


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a bag: its type, the number of its messages, its offered QoS (YAML) and the hash of its type."""

    name: str
    message_type: str
    messages: int
    qos: str = ""
    type_hash: str = ""


@dataclass(frozen=True, slots=True)
class BagFile:
    """A storage file of a bag: its name, the number of its messages, and their first and last log time."""

    name: str
    messages: int
    start_ns: int | None = None
    end_ns: int | None = None


@dataclass(frozen=True, slots=True)
class BagMetadata:
    """A bag as a whole; `files` are named in metadata.yaml only, since a recording does not know its own name."""

    storage: str
    topics: Sequence[BagTopic]
    start_ns: int | None
    end_ns: int | None
    files: Sequence[BagFile] = ()
    distribution: str = ""
    custom_data: Mapping[str, str] = field(default_factory=dict)


def record_of(bag: BagMetadata) -> dict[str, str]:
    """The entries of the MCAP metadata record `rosbag2`."""
    return {KEY: _text(_about(bag))}


def metadata_yaml(bag: BagMetadata) -> str:
    """The text of the metadata.yaml of a bag's folder."""
    return _text({"rosbag2_bagfile_information": _about(bag)})


def _about(bag: BagMetadata) -> dict[str, object]:
    names = any(is_named(topic.qos) for topic in bag.topics)
    about: dict[str, object] = {"version": _OF_NAMES if names else _OF_TEXT, "storage_identifier": bag.storage}
    about |= _lasts(bag.start_ns, bag.end_ns)
    about["message_count"] = sum(topic.messages for topic in bag.topics)
    about["topics_with_message_count"] = [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.message_type,
                "serialization_format": "cdr",
                "offered_qos_profiles": _profiles(topic.qos) if names else topic.qos,
                "type_description_hash": topic.type_hash,
            },
            "message_count": topic.messages,
        }
        for topic in bag.topics
    ]
    about |= {"compression_format": "", "compression_mode": ""}
    about["relative_file_paths"] = [file.name for file in bag.files]
    about["files"] = [
        {"path": file.name, **_lasts(file.start_ns, file.end_ns), "message_count": file.messages} for file in bag.files
    ]
    about["custom_data"] = dict(sorted(bag.custom_data.items())) or None
    about["ros_distro"] = bag.distribution
    return about


def joined_profiles(texts: Iterable[str]) -> str:
    """The profiles of several publishers as one text; what cannot be read is left out, unless it is alone."""
    found = list(dict.fromkeys(text.rstrip() for text in texts if text.strip() not in {"", "[]"}))
    if len(found) < 2 or all(text.startswith("- ") for text in found):
        return "\n".join(found)
    profiles = [one for text in found for one in _profiles(text)]
    return numbered(_text(profiles)).rstrip()


def _profiles(text: str) -> list[object]:
    """Profiles with names; none where the text cannot be read."""
    try:
        found = YAML(typ="safe", pure=True).load(named(text))
    except YAMLError:
        return []
    return found if isinstance(found, list) else []


def _lasts(start_ns: int | None, end_ns: int | None) -> dict[str, object]:
    if start_ns is None or end_ns is None:
        start_ns, end_ns = _NEVER_NS, _NEVER_NS
    return {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
    }


def _text(document: object) -> str:
    yaml = YAML()
    yaml.width = 1 << 30
    stream = io.StringIO()
    yaml.dump(document, stream)
    return stream.getvalue()
