"""Which topics are scans, and what is said of those that are not."""

from mcap_landmarks.channels import ODOMETRY, SCAN
from mcap_landmarks.inspection.topic_roles import ROLES, could_be, topics_for

ECHOES, SONAR = ("/echoes", "sensor_msgs/msg/MultiEchoLaserScan"), ("/sonar", "sensor_msgs/msg/Range")
PLANAR, CLOUD = ("/scan", "sensor_msgs/msg/LaserScan"), ("/points", "sensor_msgs/msg/PointCloud2")


def test_several_echoes_are_a_scan_where_there_is_no_other() -> None:
    assert topics_for(ROLES[SCAN], [ECHOES, CLOUD]) == ["/echoes"]
    assert topics_for(ROLES[SCAN], [ECHOES, PLANAR]) == ["/scan"]


def test_what_sounds_like_a_scan_and_is_none_is_named() -> None:
    assert could_be([SONAR], SCAN) == "/sonar is sensor_msgs/msg/Range: single ranges are not used"
    said = could_be([("/velodyne_packets", "velodyne_msgs/msg/VelodyneScan"), CLOUD], SCAN)
    assert said.startswith("/points could be it, choose with --scan-from TOPIC; /velodyne_packets is velodyne_msgs/msg")
    assert could_be([("/chatter", "std_msgs/msg/String")], SCAN) == ""
    assert could_be([SONAR], ODOMETRY) == ""
