"""What of the metadata of bags is true of what was made of them: who recorded it with what, and what they noted."""

from collections import Counter
from collections.abc import Mapping, Sequence

from mcap_landmarks.messages.qos import KEY
from mcap_landmarks.runs.rosbag2_metadata import BagMetadata, BagTopic, joined_profiles, record_of
from mcap_landmarks.sources import BagDescription
from mcap_landmarks.stage import Connection

Told = Sequence[tuple[str, BagDescription]]


def custom_data_of(told: Told) -> tuple[dict[str, str], list[str]]:
    """The custom data of all inputs, and notes on those that contradict each other: the first value stays."""
    found: dict[str, tuple[str, str]] = {}
    notes = []
    for name, about in told:
        for key, value in about.custom_data.items():
            first, kept = found.setdefault(key, (name, value))
            if value != kept:
                notes.append(f"custom_data {key} is {kept!r} in {first} and {value!r} in {name}; the first was kept")
    return {key: value for key, (_, value) in found.items()}, notes


def bag_of(told: Told, counts: Mapping[Connection, int], span_ns: Sequence[int]) -> BagMetadata:
    """An output with so many messages as a bag; `span_ns` are the first and last log time, nothing without messages."""
    distributions = dict.fromkeys(about.distribution for _, about in told if about.distribution)
    distribution = next(iter(distributions)) if len(distributions) == 1 else ""
    start_ns, end_ns = span_ns or (None, None)
    custom_data, _ = custom_data_of(told)
    return BagMetadata("mcap", topics_of(counts), start_ns, end_ns, distribution=distribution, custom_data=custom_data)


def bag_record(told: Told, counts: Mapping[Connection, int], span_ns: Sequence[int]) -> dict[str, str] | None:
    """The `rosbag2` record of such an output; None if no input had anything to tell."""
    bag = bag_of(told, counts, span_ns)
    has_told = bag.custom_data or any(about.distribution for _, about in told)
    return record_of(bag) if has_told else None


def topics_of(counts: Mapping[Connection, int]) -> list[BagTopic]:
    """The topics of a bag, each once: with the quality of service of all its channels, one after the other."""
    messages: Counter[str] = Counter()
    connections: dict[str, list[Connection]] = {}
    for connection, count in counts.items():
        messages[connection.topic] += count
        connections.setdefault(connection.topic, []).append(connection)
    return [
        BagTopic(
            topic,
            ones[0].message_type,
            messages[topic],
            joined_profiles(one.metadata.get(KEY, "") for one in ones),
            ones[0].metadata.get("topic_type_hash", ""),
        )
        for topic, ones in sorted(connections.items())
    ]
