"""Every channel that we write or read by name, once."""

from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.poses import Odometry, Path, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Channel

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
SCAN_FILTERED = Channel("/landmarks/scan_filtered", LaserScan)
SCENE_OBJECTS = Channel("/landmarks/scene_objects", SceneObjects)
SCENE_MARKERS = Channel("/landmarks/scene_markers", MarkerArray)

MAP_MARKERS = Channel("/landmarks/map_markers", MarkerArray)
MAP_PATH = Channel("/landmarks/map_path", Path)
MAP_POSE = Channel("/landmarks/map_pose", PoseStamped)

MAP = Channel("/landmarks/map", SceneObjects)
MATCH = Channel("/landmarks/match", LandmarkMatch)
POSE = Channel("/landmarks/pose", PoseStamped)
POSE_COVARIANCE = Channel("/landmarks/pose_cov", PoseWithCovarianceStamped)

TRUTH_POSE = Channel("/ground_truth/pose", PoseStamped)
TRUTH_OBJECTS = Channel("/ground_truth/objects", SceneObjects)
TRUTH_DETECTIONS = Channel("/ground_truth/detections", Detections)

RESULTS, TRUTH = "/landmarks/", "/ground_truth/"
"""What the topics of results and of the generator's truth begin with."""
NO_SCENES = frozenset({SCAN_OBJECTS.topic, MAP.topic, TRUTH_OBJECTS.topic})
"""Topics of ours whose messages are of the scenes' type, but are none."""

MAP_FRAME, ODOM_FRAME, BASE_FRAME = "map", "odom", "base_footprint"
