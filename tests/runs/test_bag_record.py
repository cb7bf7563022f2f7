"""What rosbag2 keeps of a bag stays true of what was made of it."""

from pathlib import Path

from mcap_landmarks.channels import SCAN_OBJECTS
from mcap_landmarks.messages.qos import is_named, qos_profile
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.rosbag2_metadata import BagMetadata, joined_profiles, record_of
from mcap_landmarks.sources import recorded_metadata
from ruamel.yaml import YAML

from tests.cli.calls import call
from tests.cli.test_cluster import content


def test_a_run_renews_the_record_of_the_log(tmp_path: Path) -> None:
    log, out = tmp_path / "log.mcap", tmp_path / "out.mcap"
    bag = BagMetadata("mcap", [], None, None, distribution="jazzy", custom_data={"operator": "ada"})
    with create_recording(log, {"rosbag2": record_of(bag)}) as writer:
        for stamped in content():
            writer.add(stamped)
    assert call("cluster", log, "-o", out) == 0
    before = out.read_bytes()
    with open_recording(out) as recording:
        about = recorded_metadata(recording.metadata)
        assert about.messages == sum(entry.count for entry in recording.channels)
        assert about.types[SCAN_OBJECTS.topic] == "vision_msgs/msg/Detection3DArray"
        assert (about.distribution, about.custom_data) == ("jazzy", {"operator": "ada"})
    assert call("cluster", log, "-o", out) == 0
    assert out.read_bytes() == before


def test_profiles_of_several_publishers_are_one_list() -> None:
    text = qos_profile()
    assert joined_profiles([text, "", "[]", text + "\n"]) == text
    found = joined_profiles([text, "[{history: keep_all, depth: 0}]", "[", "a: b"])
    assert [one["depth"] for one in YAML(typ="safe", pure=True).load(found)] == [10, 0]
    assert not is_named(found)
    assert joined_profiles([]) == ""
