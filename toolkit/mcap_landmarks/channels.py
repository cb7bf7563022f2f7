"""Every channel that we write or read by name, once, and where those go that have no topic of their own."""

from itertools import takewhile

from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.poses import Odometry, Path, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.stage import Channel, InputLog

CAMERA_IMAGE = Channel("/camera/image_raw/compressed", CompressedImage)
CAMERA_INFO = Channel("/camera/camera_info", CameraInfo)
SCAN = Channel("/scan", LaserScan)
SECOND_SCAN = Channel("/scan_2", LaserScan)
ODOMETRY = Channel("/odom", Odometry)
TF = Channel("/tf", TFMessage)
TF_STATIC = Channel("/tf_static", TFMessage)

DETECTIONS = Channel("/landmarks/detections", Detections)
ANNOTATIONS = Channel("/camera/annotations", ImageAnnotations)
SCAN_OBJECTS = Channel("/landmarks/scan_objects", ScanObjects)
CLUSTERED_CLOUD = Channel("/landmarks/clustered_cloud", ClusteredCloud)
SCAN_FILTERED = Channel("/landmarks/scan_filtered", LaserScan)
SCENE_OBJECTS = Channel("/landmarks/scene_objects", SceneObjects)
SCENE_VELOCITIES = Channel("/landmarks/scene_velocities", SceneVelocities)
SCENE_MARKERS = Channel("/landmarks/scene_markers", MarkerArray)

MAP_MARKERS = Channel("/landmarks/map_markers", MarkerArray)
MAP_PATH = Channel("/landmarks/map_path", Path)
MAP_POSE = Channel("/landmarks/map_pose", PoseStamped)

MAP = Channel("/landmarks/map", SceneObjects)
MATCH = Channel("/landmarks/match", LandmarkMatch)
POSE = Channel("/landmarks/pose", PoseStamped)
POSE_COVARIANCE = Channel("/landmarks/pose_cov", PoseWithCovarianceStamped)
LOCALIZED_PATH = Channel("/landmarks/path", Path)

TRUTH_POSE = Channel("/ground_truth/pose", PoseStamped)
TRUTH_OBJECTS = Channel("/ground_truth/objects", SceneObjects)
TRUTH_DETECTIONS = Channel("/ground_truth/detections", Detections)

RESULTS, TRUTH = "/landmarks/", "/ground_truth/"
"""What the topics of results and of the generator's truth begin with."""
NO_SCENES = frozenset({SCAN_OBJECTS.topic, MAP.topic, TRUTH_OBJECTS.topic})
"""Topics of ours whose messages are of the scenes' type, but are none."""
SHARED = frozenset({TF.topic})
"""Topics that many write to: results there stand beside a log's own messages, elsewhere in their place."""
DRAWN = frozenset({MAP_MARKERS.topic})
"""Topics of ours that viewers draw and nothing reads: the stage that ran last has them, other results stay."""

MAP_FRAME, ODOM_FRAME, BASE_FRAME = "map", "odom", "base_footprint"


def annotations_topic(log: InputLog, _config: object) -> str:
    """The topic of ANNOTATIONS for a log's primary channel, images: in the camera's namespace, where Foxglove looks.

    That is the parent of the CameraInfo topic that shares most of the image's path, else of the image topic.
    """
    image, wanted = log.primary.topic, CameraInfo.ROS_TYPE
    infos = [entry.connection.topic for entry in log.channels if entry.connection.message_type == wanted]
    shared = {topic: shared_namespaces(image, topic) for topic in infos}
    base = image.removesuffix("/compressed")
    nearest = max(sorted(infos), key=shared.__getitem__, default=base)
    if len(infos) > 1 and not shared[nearest]:  # several cameras, none of them this one
        nearest = base
    return f"{nearest.rpartition('/')[0]}/{ANNOTATIONS.topic.rpartition('/')[2]}"


def shared_namespaces(one: str, other: str) -> int:
    """The number of namespaces that two topics share from their roots on."""
    pairs = zip(one.strip("/").split("/")[:-1], other.strip("/").split("/")[:-1], strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
