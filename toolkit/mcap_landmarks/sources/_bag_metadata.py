"""What rosbag2 says of a bag as a whole, in metadata.yaml, in SQLite and in MCAP."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import accumulate
from pathlib import Path, PurePosixPath

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from mcap_landmarks.sources._ros2_types import known_distribution
from mcap_landmarks.sources._shape import BagDescription

METADATA = "metadata.yaml"
_LONGEST, _DEEPEST = 4 << 20, 100
"""Characters, of which rosbag2 writes some 200 for a file and 500 for a topic, and brackets within each other."""
_RECORD, _KEY, _ROOT = "rosbag2", "serialized_metadata", "rosbag2_bagfile_information"


def metadata_beside(path: Path) -> BagDescription | None:
    """What a metadata.yaml says: nothing if there is none, None if it is damaged."""
    try:
        return described(path.read_text())
    except FileNotFoundError:
        return BagDescription()
    except (OSError, UnicodeDecodeError):
        return None


def recorded_metadata(records: Mapping[str, Mapping[str, str]]) -> BagDescription:
    """What the metadata records of an MCAP file say; nothing if that is damaged or not there."""
    return described(records.get(_RECORD, {}).get(_KEY, "")) or BagDescription()


def _is_nested(text: str) -> bool:
    """Whether brackets stand in each other more often than anybody writes: each costs the parser all those before."""
    return max(accumulate({"[": 1, "{": 1, "]": -1, "}": -1}.get(sign, 0) for sign in text)) > _DEEPEST


@lru_cache(maxsize=16)
def described(text: str) -> BagDescription | None:
    """What a text says, as in metadata.yaml or without its root as in MCAP; None if it is none such."""
    if not text.strip() or len(text) > _LONGEST or _is_nested(text):
        return None
    try:
        document = YAML(typ="base", pure=True).load(text)  # every value as it is written: custom data are texts
    except (YAMLError, RecursionError, ValueError):
        return None
    about = document.get(_ROOT, document) if isinstance(document, dict) else None
    return _description(about) if isinstance(about, dict) else None


def _description(about: Mapping[str, object]) -> BagDescription:
    files, topics, custom = (
        about.get(key) for key in ("relative_file_paths", "topics_with_message_count", "custom_data")
    )
    count = about.get("message_count")
    name = about.get("ros_distro")
    return BagDescription(
        _names(files),
        name if isinstance(name, str) and known_distribution(name) else None,
        dict(_types(topics)) if isinstance(topics, list) else {},
        int(count) if isinstance(count, str) and count.isdecimal() and len(count) < 20 else None,
        {key: one for key, one in custom.items() if isinstance(one, str)} if isinstance(custom, dict) else {},
    )


def _names(files: object) -> tuple[str, ...]:
    found = files if isinstance(files, list) else []
    return tuple(PurePosixPath(one.replace("\\", "/")).name for one in found if isinstance(one, str))


def _types(topics: list[object]) -> Iterator[tuple[str, str]]:
    for one in topics:
        about = one.get("topic_metadata") if isinstance(one, dict) else None
        name, type_ = (about.get("name"), about.get("type")) if isinstance(about, dict) else (None, None)
        if isinstance(name, str) and isinstance(type_, str):
            yield name, type_
