"""What others recorded and reported: what can be used is, and the rest is refused by name."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cases.steps import check_case

CASES = (
    "bitrot_one_chunk",
    "custom_data_db3",
    "custom_data_mcap",
    "distro_rolling",
    "foxglove_json",
    "foxglove_protobuf",
    "foxglove_protobuf_ros_odom",
    "humble_custom_type",
    "info_binning",
    "info_half_size",
    "metadata_first_split_only",
    "no_odometry",
    "objects_in_optical_frame",
    "odom_first_stamp_zero",
    "odom_jump",
    "odom_nan_quaternion",
    "odom_of_camera_link",
    "odom_one_future_stamp",
    "odom_reset",
    "odom_twist_only",
    "odom_two_robots",
    "odom_zero_quaternion",
    "onnx_nms_in_graph",
    "onnx_v8_head",
    "ros1_crlf_definition",
    "ros1_empty_definition",
    "ros1_in_mcap",
    "ros1_nested_type_missing",
    "scan_in_degrees",
    "scan_in_mm",
    "scan_range_max_zero",
    "scan_time_increment_us",
    "output_named_bag",
    "schema_short_names",
    "schemas_missing",
    "service_event_topic",
    "split_last_part_empty",
    "split_mcap_last_part_empty",
    "std_types_no_distro",
    "tf_static_300ms_late",
    "tf_static_at_the_end",
    "topic_two_types",
    "zero_tail",
)


@pytest.mark.parametrize("name", CASES)
def test_what_is_expected_of_a_case_holds(
    name: str,
    case_input: Callable[[str], Path],
    site: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    check_case(name, case_input(name), site, monkeypatch, capsys)
