"""The text that rosbag2 reads of a bag as a whole."""

from mcap_landmarks.messages.qos import qos_profile
from mcap_landmarks.runs.rosbag2_metadata import KEY, BagFile, BagMetadata, BagTopic, metadata_yaml, record_of
from ruamel.yaml import YAML

BAG = BagMetadata(
    "mcap",
    [BagTopic("/scan", "sensor_msgs/msg/LaserScan", 3, qos_profile(), "RIHS01_ab"), BagTopic("/x", "a_msgs/msg/X", 2)],
    1_000,
    4_500,
    [BagFile("bag_0.mcap", 5, 1_000, 4_500)],
    "jazzy",
    {"run": "17", "operator": 'ada: "#1"\nyes', "none": "~"},
)


def test_metadata_of_a_folder_say_what_is_in_it() -> None:
    found = YAML(typ="safe", pure=True).load(metadata_yaml(BAG))["rosbag2_bagfile_information"]
    assert (found["version"], found["storage_identifier"], found["message_count"]) == (8, "mcap", 5)
    assert (found["starting_time"]["nanoseconds_since_epoch"], found["duration"]["nanoseconds"]) == (1_000, 3_500)
    assert found["relative_file_paths"] == ["bag_0.mcap"]
    assert found["custom_data"] == BAG.custom_data
    counts = {one["topic_metadata"]["name"]: one["message_count"] for one in found["topics_with_message_count"]}
    assert counts == {"/scan": 3, "/x": 2}


def test_a_recording_does_not_know_its_own_name() -> None:
    found = YAML(typ="safe", pure=True).load(record_of(BagMetadata("mcap", [], None, None))[KEY])
    assert (found["relative_file_paths"], found["files"]) == ([], [])
    assert (found["starting_time"]["nanoseconds_since_epoch"], found["duration"]["nanoseconds"]) == (2**63 - 1, 0)
